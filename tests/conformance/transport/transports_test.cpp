#include "suite.hpp"

namespace rtpm::rpc::test {

INSTANTIATE_TEST_SUITE_P(Udp, TransportSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, TransportSuite, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, TransportSuite, testing::Values(Transport::kSharedMemory));

}  // namespace rtpm::rpc::test
