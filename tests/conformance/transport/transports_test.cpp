#include "suite.hpp"

namespace rtpm::rpc::test {

INSTANTIATE_TEST_SUITE_P(Udp, TransportSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, TransportSuite, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, TransportSuite, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Udp, WireSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, WireSuite, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, WireSuite, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(FaultyUdp, TransportSuite, testing::Values(kFaultyUdp));
INSTANTIATE_TEST_SUITE_P(SealedUdp, TransportSuite, testing::Values(kSealedUdp));
INSTANTIATE_TEST_SUITE_P(SealedTcp, TransportSuite, testing::Values(kSealedTcp));
INSTANTIATE_TEST_SUITE_P(SealedUdp, LosslessSuite, testing::Values(kSealedUdp));
INSTANTIATE_TEST_SUITE_P(SealedTcp, LosslessSuite, testing::Values(kSealedTcp));
INSTANTIATE_TEST_SUITE_P(Udp, LosslessSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, LosslessSuite, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, LosslessSuite, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Local, LosslessSuite, testing::Values(Transport::kLocal));
INSTANTIATE_TEST_SUITE_P(Local, TransportSuite, testing::Values(Transport::kLocal));

}  // namespace rtpm::rpc::test
