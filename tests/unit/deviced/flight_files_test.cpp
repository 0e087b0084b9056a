#include "flight_files.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>

#include "flight_format.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::test {
namespace {

using deviced::FlightFiles;

std::string name_of(std::uint64_t file) {
  return "lab-arm0." + std::to_string(file) + std::string(deviced::flight_file_ending());
}

/// A start of the program with one fault of lab/arm0.
void write_one(const std::string& folder) {
  gvd::FlightRecorder recorder;
  gvd::FlightRecord record;
  record.faults.set(driver::Fault::kEmergencyStop);
  for (std::size_t i = 0; i <= gvd::FlightRecorder::kAfterCount; ++i)
    recorder.record(record);
  ASSERT_EQ(recorder.number(), 1u);
  FlightFiles files(folder);
  files.add("lab/arm0", recorder);
  ASSERT_TRUE(files.start());
}

TEST(FlightFiles, BeginWithTheFirst) {
  const TemporaryFolder folder;
  write_one(folder.path());
  EXPECT_TRUE(std::filesystem::exists(folder.file(name_of(1))));
}

TEST(FlightFiles, ReplaceTheOldestOfEarlierStarts) {
  constexpr std::uint64_t kOldest = 5;
  const TemporaryFolder folder;
  for (std::uint64_t age = 0; age < FlightFiles::kFileCountMax; ++age) {
    const std::uint64_t file =
        (kOldest + FlightFiles::kFileCountMax - 1 - age) % FlightFiles::kFileCountMax;
    const auto written = std::filesystem::file_time_type::clock::now() - std::chrono::minutes{age};
    std::filesystem::last_write_time(folder.write(name_of(file), "earlier"), written);
  }
  write_one(folder.path());
  for (std::uint64_t file = 0; file < FlightFiles::kFileCountMax; ++file)
    EXPECT_EQ(folder.read(name_of(file)) == "earlier", file != kOldest) << file;
}

}  // namespace
}  // namespace rtpm::test
