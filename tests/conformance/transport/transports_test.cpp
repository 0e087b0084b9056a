#include "suite.hpp"

namespace rtpm::rpc::test {

INSTANTIATE_TEST_SUITE_P(Udp, TransportSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, TransportSuite, testing::Values(Transport::kTcp));

}  // namespace rtpm::rpc::test
