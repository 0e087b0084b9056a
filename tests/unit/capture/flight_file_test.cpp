#include "rtpm/capture/flight_file.hpp"

#include <flatbuffers/reflection.h>
#include <time.h>
#include <device_events.rtpm.events.hpp>

#include "../recording/recorded.hpp"
#include "rtpm/rt/clock.hpp"

// A flight record written as a recording, and read back.
namespace rtpm::capture {
namespace {

std::int64_t wall_ns() {
  timespec wall{};
  ::clock_gettime(CLOCK_REALTIME, &wall);
  return std::int64_t{wall.tv_sec} * 1'000'000'000 + wall.tv_nsec;
}

class FlightFile : public testing::Test {
 protected:
  /// 100 cycles at 1 kHz; the last one ends now.
  void SetUp() override {
    log_ = {.number = 2, .cause = gvd::FlightCause::kTooFast, .cycle = 90, .record_count = 100};
    const MonotonicTime end = rt::now();
    for (std::uint64_t cycle = 1; cycle <= 100; ++cycle) {
      gvd::FlightRecord record;
      record.cycle = cycle;
      record.time = end - (100 - cycle) * std::chrono::milliseconds{1};
      record.position_m = {0.25 * static_cast<double>(cycle), 2, 3};
      record.applied.force_newton = {4, 5, 6};
      record.has_command = cycle % 2 == 0;
      record.heat = 0.5;
      log_.records.push_back(record);
    }
  }
  [[nodiscard]] std::unique_ptr<recording::FileReader> written() const {
    const auto done = write_flight_file(file_, "lab/arm0", log_);
    EXPECT_TRUE(done) << done.error().text();
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader) << reader.error().text();
    return reader ? std::move(*reader) : nullptr;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("flight");
  gvd::FlightLog log_;
};

TEST_F(FlightFile, HasOneChannelWithATableAsItsSchema) {
  const auto reader = written();
  ASSERT_NE(reader, nullptr);
  ASSERT_EQ(reader->channels().size(), 1u);
  EXPECT_EQ(reader->channels().at(1).topic, "lab/arm0/flight");
  EXPECT_EQ(reader->channels().at(1).message_encoding, "flatbuffer");
  const recording::Schema& schema = reader->schemas().at(1);
  EXPECT_EQ(schema.name, "rtpm.device.FlightCycle");
  EXPECT_EQ(schema.encoding, "flatbuffer");
  const auto* const root = reflection::GetSchema(schema.data.data())->root_table();
  ASSERT_NE(root, nullptr);
  EXPECT_EQ(root->name()->str(), schema.name);
  EXPECT_FALSE(root->is_struct());
}

TEST_F(FlightFile, HasEachCycleAsATable) {
  const auto reader = written();
  ASSERT_NE(reader, nullptr);
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 100u);
  for (std::size_t i = 0; i < messages.size(); ++i) {
    EXPECT_EQ(messages[i].sequence, i + 1);
    const auto& cycle =
        *flatbuffers::GetRoot<device::FlightCycle>(messages[i].text.data())->cycle();
    EXPECT_EQ(cycle.cycle(), i + 1);
    EXPECT_EQ(cycle.time_ns(), to_ns(log_.records[i].time));
    EXPECT_EQ(cycle.position_m().x(), 0.25 * static_cast<double>(i + 1));
    EXPECT_EQ(cycle.applied_newton().z(), 6);
    EXPECT_EQ(cycle.heat(), 0.5);
    EXPECT_EQ(cycle.has_command(), i % 2 == 1);
  }
}

TEST_F(FlightFile, HasTheCyclesTimesSince1970) {
  const std::int64_t begin_ns = wall_ns() - std::int64_t{100'000'000};
  const auto reader = written();
  ASSERT_NE(reader, nullptr);
  const auto messages = recording::read_all(*reader);
  ASSERT_EQ(messages.size(), 100u);
  EXPECT_EQ(messages[99].log_time_ns - messages[0].log_time_ns, 99'000'000u);
  const auto first_ns = static_cast<std::int64_t>(messages[0].log_time_ns);
  constexpr std::int64_t kAdjustment = 10'000'000'000;  // The wall clock may be adjusted meanwhile.
  EXPECT_NEAR(static_cast<double>(first_ns - begin_ns), 0, static_cast<double>(kAdjustment));
}

TEST_F(FlightFile, UsesTheClockOfItsHost) {
  const auto here = recording::read_all(*written());
  file_ = folder_.fresh("other");
  log_.clock_offset = std::chrono::hours{5};
  for (gvd::FlightRecord& record : log_.records)
    record.time += std::chrono::hours{5};
  const auto there = recording::read_all(*written());
  ASSERT_EQ(here.size(), there.size());
  EXPECT_LT(there[0].log_time_ns - here[0].log_time_ns + 1'000'000'000, 2'000'000'000u);
}

TEST_F(FlightFile, SaysWhatItIsAbout) {
  const auto reader = written();
  ASSERT_NE(reader, nullptr);
  const auto metadata = reader->read_metadata();
  ASSERT_TRUE(metadata);
  ASSERT_EQ(metadata->size(), 1u);
  const auto& values = metadata->front().values;
  EXPECT_EQ(metadata->front().name, "rtpm.flight");
  EXPECT_EQ(values.at("device"), "lab/arm0");
  EXPECT_EQ(values.at("cause"), "too fast");
  EXPECT_EQ(values.at("number"), "2");
  EXPECT_EQ(values.at("fault_cycle"), "90");
  EXPECT_EQ(values.at("cycle_count"), "100");
}

TEST_F(FlightFile, ReplacesAnotherOnlyOnRequest) {
  recording::put_content(file_, "mine");
  const auto refused = write_flight_file(file_, "lab/arm0", log_);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("exists"), std::string::npos) << refused.error().text();
  EXPECT_EQ(recording::content_of(file_), "mine");
  recording::put_content(file_ + ".part", "of a program that died");
  ASSERT_TRUE(write_flight_file(file_, "lab/arm0", log_, recording::Existing::kReplace));
  EXPECT_TRUE(recording::FileReader::open(file_));
  EXPECT_FALSE(std::filesystem::exists(file_ + ".part"));
}

TEST_F(FlightFile, IsAnErrorIfItCannotBeWritten) {
  const std::string file = file_ + "/none/flight.mcap";
  for (const recording::Existing existing :
       {recording::Existing::kRefuse, recording::Existing::kReplace}) {
    const auto failed = write_flight_file(file, "lab/arm0", log_, existing);
    ASSERT_FALSE(failed);
    EXPECT_NE(failed.error().text().find("none/flight.mcap"), std::string::npos);
  }
}

}  // namespace
}  // namespace rtpm::capture
