#include "review/review.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <device_events.rtpm.events.hpp>
#include <filesystem>
#include <fstream>
#include <memory>
#include <trial.rtpm.events.hpp>

#include "../exports/example_recording.hpp"
#include "recording/folder.hpp"
#include "rtpm/capture/cut.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/recording/notes.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "rtpm/test/memory.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"

// The review of a recording: its overview, its windows, and what happened in it.
namespace rtpm::console {
namespace {

constexpr std::uint64_t kBeginNs = 1'700'000'000'000'000'000;
constexpr std::uint64_t kMs = 1'000'000;

/// A channel of a recording that is being written.
class EventChannel {
 public:
  EventChannel(recording::FileWriter& writer, const std::string& schema, const std::string& type,
               const std::string& topic, std::map<std::string, std::string> metadata = {})
      : writer_(writer) {
    std::string error;
    dynamic_ = schema::Dynamic::make_for_event(schema, type, error);
    EXPECT_TRUE(dynamic_) << error;
    const auto number = writer.add_schema(
        {.name = type, .encoding = "flatbuffer", .data = dynamic_->flat_reflection(type)});
    EXPECT_TRUE(number);
    const auto channel = writer.add_channel({.schema_id = *number,
                                             .topic = topic,
                                             .message_encoding = "flatbuffer",
                                             .metadata = std::move(metadata)});
    EXPECT_TRUE(channel);
    number_ = *channel;
  }

  void put(std::uint64_t time_ns, const std::string& json) {
    std::string error;
    const auto payload = dynamic_->encode(dynamic_->event(), json, error);
    ASSERT_TRUE(payload) << error;
    const auto table = dynamic_->as_table(dynamic_->event(), *payload);
    ASSERT_TRUE(table);
    ASSERT_TRUE(writer_.write({.channel_id = number_,
                               .log_time_ns = time_ns,
                               .publish_time_ns = time_ns,
                               .data = *table}));
  }

 private:
  recording::FileWriter& writer_;
  std::unique_ptr<schema::Dynamic> dynamic_{};
  std::uint16_t number_ = 0;
};

template <class Event>
EventChannel channel_of(recording::FileWriter& writer, const std::string& topic,
                        std::map<std::string, std::string> metadata = {}) {
  const auto& type = Event::kDescriptor;
  return {writer, std::string(type.schema), std::string(type.name), topic, std::move(metadata)};
}

constexpr const char* kSchema = R"(
attribute "rtpm_event";
attribute "rtpm_unit";
namespace lab;
table Value (rtpm_event: 77) { x:double (rtpm_unit: "m"); count:uint; }
)";

class ReviewOfARecording : public testing::Test {
 protected:
  /// `seconds` of a sine of 1 Hz at 1 kHz, in chunks of a second.
  void write_sine(int seconds) {
    auto writer = recording::FileWriter::create(folder_.fresh("run"));
    ASSERT_TRUE(writer);
    EventChannel values(**writer, kSchema, "lab.Value", "lab/value");
    for (int i = 0; i < seconds * 1000; ++i) {
      values.put(kBeginNs + static_cast<std::uint64_t>(i) * kMs,
                 R"({"x":)" + std::to_string(std::sin(i * 2e-3 * M_PI)) + R"(,"count":)" +
                     std::to_string(i) + "}");
      if (i % 1000 == 999) {
        ASSERT_TRUE((*writer)->end_chunk());
      }
    }
    ASSERT_TRUE((*writer)->close());
  }
  [[nodiscard]] std::shared_ptr<Review> open() const {
    auto review = Review::open(folder_.path("run"), {});
    EXPECT_TRUE(review) << review.error().text();
    return review ? *review : nullptr;
  }

  recording::Folder folder_;
};

TEST_F(ReviewOfARecording, HasAnOverviewThatKeepsEveryPeak) {
  write_sine(60);
  const auto review = open();
  ASSERT_TRUE(review);
  nlohmann::ordered_json summary = review->summary();
  EXPECT_EQ(summary["progress"], 0.0);
  EXPECT_EQ(summary["fields"],
            nlohmann::ordered_json::parse(R"([{"path":"lab/value.x","unit":"m"},)"
                                          R"({"path":"lab/value.count","unit":""}])"));
  ASSERT_TRUE(review->read_overview({}));
  summary = review->summary();
  EXPECT_EQ(summary["progress"], 1.0);
  EXPECT_EQ(summary["begin_ns"], kBeginNs);
  EXPECT_EQ(summary["end_ns"], kBeginNs + 59'999 * kMs);
  const Review::Window whole{.begin_ns = kBeginNs,
                             .end_ns = kBeginNs + 60'000 * kMs,
                             .fields = {"lab/value.x", "lab/value.count"},
                             .point_count = 100};
  ASSERT_TRUE(review->is_overview_fine(whole));
  const auto answer = review->overview(whole);
  const auto& low = answer["series"][0]["low"];
  const auto& high = answer["series"][0]["high"];
  ASSERT_LE(low.size(), 101u);
  ASSERT_GT(low.size(), 50u);
  const auto bucket_ns = answer["bucket_ns"].get<std::uint64_t>();
  const auto& counts = answer["series"][1]["high"];
  for (std::size_t i = 0; i < low.size(); ++i) {
    if (low[i].is_null()) continue;
    // A second has each value of the sine, and each bucket those of its own time.
    if (bucket_ns > 1000 * kMs && i + 1 < low.size()) {
      EXPECT_NEAR(low[i].get<double>(), -1, 1e-4);
      EXPECT_NEAR(high[i].get<double>(), 1, 1e-4);
    }
    const double end_ms = static_cast<double>((i + 1) * bucket_ns) / 1e6;
    EXPECT_LE(counts[i].get<double>(), end_ms);
  }
  EXPECT_EQ(counts.back().is_null() ? counts[counts.size() - 2] : counts.back(), 59'999.0);
}

TEST_F(ReviewOfARecording, ShowsSamplesWhereThereAreFew) {
  write_sine(5);
  const auto review = open();
  ASSERT_TRUE(review);
  const Review::Window window{.begin_ns = kBeginNs + 2'500 * kMs,
                              .end_ns = kBeginNs + 2'504 * kMs,
                              .fields = {"lab/value.count"},
                              .point_count = 1000};
  EXPECT_FALSE(review->is_overview_fine(window));
  const auto answer = review->read(window, {});
  ASSERT_TRUE(answer) << answer.error().text();
  EXPECT_EQ((*answer)["is_exact"], true);
  // Also the neighbours, so that the curve reaches the window's edges.
  EXPECT_EQ((*answer)["series"][0]["values"].get<std::vector<double>>(),
            (std::vector<double>{2499, 2500, 2501, 2502, 2503, 2504, 2505}));
  EXPECT_EQ((*answer)["series"][0]["offset_ns"][1], 0);
  EXPECT_EQ((*answer)["series"][0]["offset_ns"][2], 1'000'000);
  // More than fit: bounds of buckets.
  const auto bounds = review->read({.begin_ns = kBeginNs + 1'000 * kMs,
                                    .end_ns = kBeginNs + 3'000 * kMs,
                                    .fields = {"lab/value.count"},
                                    .point_count = 100},
                                   {});
  ASSERT_TRUE(bounds);
  EXPECT_EQ((*bounds)["series"][0]["low"].size(), 100u);
  EXPECT_EQ((*bounds)["series"][0]["low"][0], 1000.0);
  EXPECT_EQ((*bounds)["series"][0]["high"][99], 3000.0);
}

TEST_F(ReviewOfARecording, ReadsOnlyTheChunksOfAWindow) {
  write_sine(20);
  // A flipped byte in the first chunk: its checksum is wrong.
  {
    std::fstream file(folder_.path("run"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(3000);
    const int byte = file.get();
    file.seekp(3000);
    file.put(static_cast<char>(byte ^ 0x55));
  }
  const auto review = open();
  ASSERT_TRUE(review);
  const Review::Window late{.begin_ns = kBeginNs + 10'000 * kMs,
                            .end_ns = kBeginNs + 10'100 * kMs,
                            .fields = {"lab/value.x"},
                            .point_count = 1000};
  const auto answer = review->read(late, {});
  ASSERT_TRUE(answer) << answer.error().text();
  EXPECT_GE((*answer)["series"][0]["values"].size(), 101u);
  // The whole has what is broken, and says so.
  EXPECT_FALSE(review->read_overview({}));
  test::expect_text(review->summary()["problem"].get<std::string>(), {"damaged"});
  Review::Window early = late;
  early.begin_ns = kBeginNs;
  early.end_ns = kBeginNs + 100 * kMs;
  EXPECT_FALSE(review->read(early, {}));
}

TEST_F(ReviewOfARecording, TakesLittleMemoryForALargeOne) {
  if (test::kHasSanitizer) GTEST_SKIP() << "sanitizers keep freed memory";
  exports::test::Example example(folder_.fresh("run"));
  exports::test::put_large(example);
  example.end();
  const test::PeakMemory memory;
  if (!memory.is_known()) GTEST_SKIP() << "this system does not measure the peak of memory";
  const auto review = open();
  ASSERT_TRUE(review);
  ASSERT_TRUE(review->read_overview({}));
  // The overview, and one chunk at a time with its index.
  EXPECT_LE(memory.growth(), std::size_t{16 + 8} << 20);
}

TEST_F(ReviewOfARecording, ThinsAMillionMarkersAndSaysSo) {
  auto writer = recording::FileWriter::create(folder_.fresh("run"));
  ASSERT_TRUE(writer);
  EventChannel first = channel_of<TrialEvent>(**writer, "rtpm.Trial/0");
  first.put(kBeginNs, R"({"note":"first"})");
  // One encoded message for all, as only their number matters.
  std::string error;
  const auto& type = TrialEvent::kDescriptor;
  const auto dynamic =
      schema::Dynamic::make_for_event(std::string(type.schema), std::string(type.name), error);
  const auto table = dynamic->encode(dynamic->event(), R"({"note":"m"})", error);
  ASSERT_TRUE(table) << error;
  constexpr std::uint64_t kCount = 1'000'000;
  for (std::uint64_t i = 1; i < kCount; ++i) {
    const std::uint64_t time_ns = kBeginNs + i * kMs;
    ASSERT_TRUE((*writer)->write(
        {.channel_id = 1, .log_time_ns = time_ns, .publish_time_ns = time_ns, .data = *table}));
  }
  ASSERT_TRUE((*writer)->close());
  const auto review = open();
  ASSERT_TRUE(review);
  ASSERT_TRUE(review->read_overview({}));
  const auto summary = review->summary();
  EXPECT_EQ(summary["marker_count"], kCount);
  const std::size_t kept = summary["markers"].size();
  EXPECT_LE(kept, 2048u);
  EXPECT_GE(kept, 900u);
  EXPECT_EQ(summary["markers"][0]["label"], "first");
  // Evenly: a half of them is in the first half of the time.
  EXPECT_NEAR(summary["markers"][kept / 2]["time_ns"].get<double>() - kBeginNs,
              static_cast<double>(kCount * kMs / 2), static_cast<double>(kCount * kMs) * 0.01);
  // A window has all of its own.
  const auto window = review->read({.begin_ns = kBeginNs + 1'000 * kMs,
                                    .end_ns = kBeginNs + 1'099 * kMs,
                                    .fields = {"rtpm.Trial/0.number"},
                                    .point_count = 1000},
                                   {});
  ASSERT_TRUE(window);
  EXPECT_EQ((*window)["markers"].size(), 100u);
}

TEST_F(ReviewOfARecording, TellsTrialsAndIncidents) {
  auto writer = recording::FileWriter::create(folder_.fresh("run"));
  ASSERT_TRUE(writer);
  const std::map<std::string, std::string> of_arm{{"rtpm.device", "lab/arm0"}};
  EventChannel trials = channel_of<TrialEvent>(**writer, "rtpm.Trial/0");
  EventChannel faults =
      channel_of<device::FaultChangedEvent>(**writer, "lab/arm0/fault_changed", of_arm);
  EventChannel stops =
      channel_of<device::StopChangedEvent>(**writer, "lab/arm0/stop_changed", of_arm);
  EventChannel leases =
      channel_of<device::LeaseChangedEvent>(**writer, "lab/arm0/lease_changed", of_arm);
  const auto at = [](int second) {
    return kBeginNs + static_cast<std::uint64_t>(second) * 1000 * kMs;
  };
  const auto fault = [](driver::Fault one) { return std::to_string(static_cast<unsigned>(one)); };
  trials.put(at(0), R"({"phase":"Begin","number":1,"condition":"soft"})");
  faults.put(at(1), R"({"cycle":1,"begun":)" + fault(driver::Fault::kTooFast) + R"(,"ended":0})");
  faults.put(at(3), R"({"cycle":2,"begun":)" + fault(driver::Fault::kDeviceGone) + R"(,"ended":)" +
                        fault(driver::Fault::kTooFast) + "}");
  stops.put(at(4), R"({"cycle":3,"is_stopped":true})");
  leases.put(at(5), R"({"cycle":3,"state":5})");
  stops.put(at(6), R"({"cycle":4,"is_stopped":false})");
  trials.put(at(7), R"({"phase":"End","number":1,"condition":"soft","response":"yes",)"
                    R"("duration_ns":7000000000})");
  trials.put(at(8), R"({"phase":"Begin","number":2})");
  trials.put(at(9), R"({"note":"coffee"})");
  ASSERT_TRUE((*writer)->close());
  const auto review = open();
  ASSERT_TRUE(review);
  ASSERT_TRUE(review->read_overview({}));
  const auto summary = review->summary();
  EXPECT_EQ(summary["trials"].size(), 2u);
  EXPECT_EQ(summary["trials"][0]["begin_ns"], at(0));
  EXPECT_EQ(summary["trials"][0]["end_ns"], at(7));
  EXPECT_EQ(summary["trials"][0]["response"], "yes");
  EXPECT_EQ(summary["trials"][1]["number"], 2);
  EXPECT_TRUE(summary["trials"][1]["end_ns"].is_null()) << "it has no end";
  EXPECT_EQ(summary["markers"][0]["label"], "coffee");
  std::map<std::string, nlohmann::json> incidents;
  for (const auto& each : summary["incidents"])
    incidents[each["kind"].get<std::string>()] = each;
  EXPECT_EQ(incidents["fault"]["device"], "lab/arm0");
  EXPECT_EQ(incidents["fault"]["begin_ns"], at(1));
  EXPECT_EQ(incidents["fault"]["end_ns"], at(3));
  EXPECT_TRUE(incidents["lost"]["end_ns"].is_null()) << "it lasts";
  EXPECT_EQ(incidents["stop"]["begin_ns"], at(4));
  EXPECT_EQ(incidents["stop"]["end_ns"], at(6));
  EXPECT_EQ(incidents["lease"]["what"], "an operator took the lease over");
}

TEST_F(ReviewOfARecording, ReadsWhatIsWholeOfOneThatWasNotEnded) {
  write_sine(10);
  std::filesystem::resize_file(folder_.path("run"),
                               std::filesystem::file_size(folder_.path("run")) / 2);
  const auto review = open();
  ASSERT_TRUE(review);
  EXPECT_EQ(review->summary()["is_complete"], false);
  ASSERT_TRUE(review->read_overview({}));
  EXPECT_GT(review->summary()["message_count"], 3000);
}

TEST_F(ReviewOfARecording, StopsWhenNobodyWaits) {
  write_sine(5);
  const auto review = open();
  ASSERT_TRUE(review);
  int count = 0;
  EXPECT_FALSE(review->read_overview([&](auto, auto) { return ++count < 3; }));
  EXPECT_EQ(count, 3);
}

class ChangesOfRecordings : public testing::Test {
 protected:
  void SetUp() override {
    auto writer = recording::FileWriter::create(folder_.fresh("run"));
    ASSERT_TRUE(writer);
    recording::write_messages(**writer, 1000);
    ASSERT_TRUE((*writer)->close());
  }
  [[nodiscard]] std::vector<std::string> names() {
    std::vector<std::string> names;
    for (const RecordingFile& file : listed_.list().files)
      names.push_back(file.file);
    return names;
  }

  recording::Folder folder_;
  RecordingFolder listed_{std::filesystem::path(folder_.path("a")).parent_path()};
};

TEST_F(ChangesOfRecordings, RenameNeverReplaces) {
  std::filesystem::copy_file(folder_.path("run"), folder_.path("other"));
  recording::put_content(folder_.fresh("third"), "other content");
  ASSERT_TRUE(recording::write_notes(folder_.path("run"), {{.time_ns = 5, .text = "a note"}}));
  const auto refused = listed_.rename("run.mcap", "third.mcap");
  ASSERT_FALSE(refused);
  test::expect_text(refused.error().text(), {"third.mcap", "already"});
  EXPECT_EQ(recording::content_of(folder_.path("third")), "other content");
  for (const char* const bad :
       {"../run.mcap", "a/b.mcap", ".hidden.mcap", "run.txt", "", "x y.mcap"}) {
    EXPECT_FALSE(listed_.rename("run.mcap", bad)) << bad;
    EXPECT_FALSE(listed_.rename(bad, "new.mcap")) << bad;
    EXPECT_FALSE(listed_.remove(bad, 1)) << bad;
  }
  ASSERT_TRUE(listed_.rename("run.mcap", "new.mcap"));
  EXPECT_EQ(names(), (std::vector<std::string>{"new.mcap", "other.mcap"}));
  const auto notes = recording::read_notes(folder_.path("new"));
  ASSERT_TRUE(notes);
  ASSERT_EQ(notes->size(), 1u) << "notes go with their recording";
}

TEST_F(ChangesOfRecordings, DeleteCanBeUndone) {
  const std::string content = recording::content_of(folder_.path("run"));
  ASSERT_TRUE(recording::write_notes(folder_.path("run"), {{.time_ns = 5, .text = "a note"}}));
  const auto id = listed_.remove("run.mcap", kBeginNs);
  ASSERT_TRUE(id) << id.error().text();
  EXPECT_TRUE(names().empty());
  ASSERT_EQ(listed_.deleted().size(), 1u);
  EXPECT_EQ(listed_.deleted()[0].file, "run.mcap");
  EXPECT_EQ(listed_.deleted()[0].deleted_ns, kBeginNs);
  // A new recording of this name is not replaced.
  recording::put_content(folder_.fresh("run"), "new");
  EXPECT_FALSE(listed_.restore(*id));
  EXPECT_EQ(recording::content_of(folder_.path("run")), "new");
  std::filesystem::remove(folder_.path("run"));
  ASSERT_TRUE(listed_.restore(*id));
  EXPECT_EQ(recording::content_of(folder_.path("run")), content);
  EXPECT_EQ(recording::read_notes(folder_.path("run"))->size(), 1u);
  EXPECT_FALSE(listed_.restore(*id)) << "it is restored already";
  for (const char* const bad : {"../run.mcap", "1-../../x.mcap", "", "x-run.mcap"})
    EXPECT_FALSE(listed_.restore(bad)) << bad;
}

TEST_F(ChangesOfRecordings, DeletedOnesGoAfterThirtyDays) {
  ASSERT_TRUE(listed_.remove("run.mcap", kBeginNs));
  EXPECT_TRUE(listed_.purge(kBeginNs + RecordingFolder::kKeptNs).empty());
  EXPECT_EQ(listed_.purge(kBeginNs + RecordingFolder::kKeptNs + 1),
            std::vector<std::string>{"run.mcap"});
  EXPECT_TRUE(listed_.deleted().empty());
}

TEST_F(ChangesOfRecordings, CutHasTheOriginalsBytes) {
  const recording::Query part{.from_ns = 200 * kMs, .to_ns = 400 * kMs};
  const auto count = capture::cut(folder_.path("run"), folder_.fresh("part"), part);
  ASSERT_TRUE(count) << count.error().text();
  auto whole = recording::FileReader::open(folder_.path("run"));
  auto cut = recording::FileReader::open(folder_.path("part"));
  ASSERT_TRUE(whole && cut);
  const auto expected = recording::read_all(**whole, part);
  const auto found = recording::read_all(**cut);
  ASSERT_EQ(found.size(), 201u);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].text, expected[i].text);
    EXPECT_EQ(found[i].log_time_ns, expected[i].log_time_ns);
    EXPECT_EQ(found[i].sequence, expected[i].sequence);
  }
}

TEST_F(ChangesOfRecordings, NotesStayAsTheyWereIfTheyAreBroken) {
  const std::string path = folder_.path("run");
  ASSERT_TRUE(recording::write_notes(path, {{.time_ns = 9, .text = "später"},
                                            {.time_ns = 5, .text = "\"quoted\"\n", .made_ns = 7}}));
  const auto notes = recording::read_notes(path);
  ASSERT_TRUE(notes) << notes.error().text();
  ASSERT_EQ(notes->size(), 2u);
  EXPECT_EQ((*notes)[0], (recording::Note{.time_ns = 5, .text = "\"quoted\"\n", .made_ns = 7}));
  EXPECT_FALSE(recording::write_notes(path, {{.time_ns = 1, .text = ""}}));
  EXPECT_FALSE(recording::write_notes(path, {{.time_ns = 1, .text = std::string(5000, 'x')}}));
  EXPECT_EQ(recording::read_notes(path)->size(), 2u);
  for (const char* const broken : {"", "[]", R"({"notes":[{"text":"x"}]})", R"({"notes":3})"}) {
    recording::put_content(recording::notes_path(path), broken);
    EXPECT_FALSE(recording::read_notes(path)) << broken;
  }
}

}  // namespace
}  // namespace rtpm::console
