#include "rtpm/safety/flight_recorder.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

namespace rtpm::gvd {
namespace {

using driver::Fault;

void record(FlightRecorder& recorder, std::uint64_t cycle, driver::Faults faults = {}) {
  FlightRecord record;
  record.cycle = cycle;
  record.applied.force_newton.x = static_cast<double>(cycle);
  record.faults = faults;
  recorder.record(record);
}

driver::Faults only(Fault fault) {
  driver::Faults faults;
  faults.set(fault);
  return faults;
}

TEST(FlightRecorder, FreezesTheCyclesAroundAFault) {
  FlightRecorder recorder;
  std::uint64_t cycle = 0;
  while (++cycle < 10'000)
    record(recorder, cycle);
  EXPECT_EQ(recorder.number(), 0u);
  EXPECT_TRUE(recorder.newest().records.empty());
  for (; cycle < 10'000 + FlightRecorder::kAfterCount; ++cycle)
    record(recorder, cycle, only(Fault::kEmergencyStop));
  EXPECT_EQ(recorder.number(), 0u) << "some cycles after it belong to it";
  for (; cycle < 30'000; ++cycle)
    record(recorder, cycle, only(Fault::kEmergencyStop));
  const FlightLog log = recorder.newest();
  EXPECT_EQ(log.number, 1u) << "one fault, however long it lasts";
  EXPECT_EQ(log.cause, FlightCause::kEmergencyStop);
  EXPECT_EQ(log.cycle, 10'000u);
  ASSERT_EQ(log.records.size(), FlightRecorder::kCycleCount);
  EXPECT_EQ(log.records.back().cycle, 10'000 + FlightRecorder::kAfterCount);
  EXPECT_EQ(log.records.front().cycle, log.records.back().cycle + 1 - FlightRecorder::kCycleCount);
  const std::string csv = to_csv(log);
  EXPECT_TRUE(csv.starts_with("# fault 1: emergency stop in cycle 10000\ncycle,"));
  EXPECT_NE(csv.find("\"emergency stop\""), std::string::npos);
}

TEST(FlightRecorder, AReaderNeverSeesHalfALog) {
  FlightRecorder recorder;
  std::atomic<bool> is_done{false};
  std::thread reader([&] {
    while (!is_done) {
      const FlightLog log = recorder.newest();
      for (std::size_t i = 1; i < log.records.size(); ++i) {
        ASSERT_EQ(log.records[i].cycle, log.records[0].cycle + i);
        ASSERT_EQ(log.records[i].applied.force_newton.x, static_cast<double>(log.records[i].cycle));
      }
    }
  });
  for (std::uint64_t cycle = 1; cycle < 200'000; ++cycle)
    record(recorder, cycle, cycle % 1000 == 0 ? only(Fault::kDeviceGone) : driver::Faults{});
  is_done = true;
  reader.join();
  EXPECT_GT(recorder.number(), 1u);
}

}  // namespace
}  // namespace rtpm::gvd
