#include <gtest/gtest.h>

#include <filesystem>

#include "example_recording.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/test/memory.hpp"
#include "rtpm/test/os.hpp"

// Exports of a recording that is much larger than the memory that they may take.
namespace rtpm::exports {
namespace {

/// Values that wait for earlier ones, and for one chunk at a time with its index.
constexpr std::size_t kWaitingByteMax = std::size_t{64} << 20;
constexpr std::size_t kReaderByteMax = std::size_t{8} << 20;

class LargeExport : public testing::Test {
 protected:
  void SetUp() override {
    if (rtpm::test::kHasSanitizer) GTEST_SKIP() << "sanitizers keep freed memory";
    test::Example example(file_);
    test::put_large(example);
    example.end();
  }
  /// The bytes that the export took at its peak.
  [[nodiscard]] std::size_t peak(const TableOptions& options) {
    const rtpm::test::PeakMemory memory;
    is_known_ = memory.is_known();
    const auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader);
    const std::string out = folder_.fresh("tables");
    const auto report = export_csv(**reader, out, options);
    EXPECT_TRUE(report) << report.error().text();
    std::filesystem::remove_all(out);
    return memory.growth();
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  bool is_known_ = true;
};

TEST_F(LargeExport, OfEachTopicTakesLittleMemory) {
  const std::size_t taken = peak({.columns = {"number"}});
  if (!is_known_) GTEST_SKIP() << "this system does not measure the peak of memory";
  EXPECT_LE(taken, kReaderByteMax);
}

TEST_F(LargeExport, JoinedTakesWhatItStates) {
  const std::size_t taken = peak({.is_joined = true, .rate_hz = 10});
  if (!is_known_) GTEST_SKIP() << "this system does not measure the peak of memory";
  EXPECT_GE(taken, kWaitingByteMax / 2) << "the values of a second wait";
  EXPECT_LE(taken, kWaitingByteMax + kReaderByteMax);
}

}  // namespace
}  // namespace rtpm::exports
