#include "rtpm/capture/session.hpp"

#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>

#include "../gvd/configuration/samples.hpp"
#include "../recording/recorded.hpp"
#include "rtpm/capture/live_recording.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// A recording states its experiment and the parameters of its devices.
namespace rtpm::capture {
namespace {

/// 2026-11-24 09:15:00 UTC.
constexpr std::uint64_t kTimeNs = 1'795'511'700'000'000'000;
const Session kSession{
    .participant = "P07", .experiment = "touch", .condition = "soft", .notes = "left hand,\ntired"};

std::string file_of(std::string_view pattern, const Session& session = kSession) {
  const auto file = session_file(pattern, session, kTimeNs);
  return file ? *file : "refused: " + file.error().text();
}

TEST(SessionFile, HasTheFieldsOfItsPattern) {
  EXPECT_EQ(file_of(kSessionPattern), "touch_P07_soft_20261124_091500.mcap");
  EXPECT_EQ(file_of("data/{participant}.mcap"), "data/P07.mcap");
  EXPECT_EQ(file_of(kSessionPattern, {.participant = "P07"}), "P07_20261124_091500.mcap")
      << "an empty field leaves no separator";
  EXPECT_EQ(file_of("{participant}_{condition}", {.participant = "P07"}), "P07.mcap");
}

TEST(SessionFile, HasSafeCharactersOnly) {
  EXPECT_EQ(file_of("{participant}", {.participant = "../../a b;c_d"}), "..-..-a-b-c-d.mcap");
  EXPECT_EQ(file_of("{condition}", {.condition = "weich, süß"}), "weich--s----.mcap");
}

TEST(SessionFile, RefusesPatternsThatMakeNoName) {
  EXPECT_NE(file_of("{subject}").find("{participant}"), std::string::npos)
      << "the message names the fields";
  EXPECT_NE(file_of("{participant").find("'{' without"), std::string::npos);
  EXPECT_NE(file_of("participant}").find("'}' without"), std::string::npos);
  EXPECT_NE(file_of("{participant}", {}).find("no name"), std::string::npos);
}

TEST(SessionFile, NeverHasTheNameOfAnother) {
  const recording::Folder folder;
  const std::string path = folder.fresh("P07.mcap");
  EXPECT_EQ(free_path(path), path);
  recording::put_content(path, "first");
  const std::string second = free_path(path);
  EXPECT_TRUE(second.ends_with("-2.mcap")) << second;
  recording::put_content(second, "second");
  EXPECT_TRUE(free_path(path).ends_with("-3.mcap"));
}

TEST(Sessions, AreRefusedWithTextsThatCantBeShown) {
  EXPECT_TRUE(check(kSession));
  Session session = kSession;
  session.participant = "P07\x1b[2J";
  ASSERT_FALSE(check(session));
  EXPECT_NE(check(session).error().text().find("participant"), std::string::npos);
  session = kSession;
  session.condition = std::string(kSessionTextSizeMax + 1, 'x');
  EXPECT_FALSE(check(session));
  session = kSession;
  session.notes = "\xff";
  EXPECT_FALSE(check(session));
}

/// The configuration of a device, at a hub in this program.
class SessionTest : public testing::Test {
 protected:
  void SetUp() override {
    auto hub = events::HubServer::create(node_, {.name = ""});
    ASSERT_TRUE(hub) << hub.error().text();
    hub_ = std::move(*hub);
    auto manager = gvd::ConfigurationManager::create(device_);
    ASSERT_TRUE(manager) << manager.error().text();
    manager_ = std::move(*manager);
    rpc::ServerConfig config;
    config.realtime = rt::RealtimeMode::kOff;
    server_ = *rpc::Server::create(config);
    ASSERT_TRUE(server_->add("arm0/config", manager_->servant()));
    ASSERT_TRUE(server_->start());
    url_ = server_->url("arm0");
  }
  void TearDown() override { server_->stop(); }

  [[nodiscard]] std::unique_ptr<LiveRecording> start(const std::string& device) {
    auto started = LiveRecording::start(
        node_, file_, {.hub = hub_->url(), .session = kSession, .devices = {device}});
    EXPECT_TRUE(started) << started.error().text();
    return started ? std::move(*started) : nullptr;
  }

  recording::Folder folder_{};
  std::string file_ = folder_.fresh("session.mcap");
  rpc::Node node_{{.default_deadline = std::chrono::seconds{5}}};
  test::SampleDevice device_{};
  std::unique_ptr<gvd::ConfigurationManager> manager_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<events::HubServer> hub_{};
  std::string url_{};
};

TEST_F(SessionTest, HasTheParametersAndTheirChanges) {
  auto recording = start(url_);
  ASSERT_NE(recording, nullptr);
  const auto count = [&] { return recording->status().recorder.message_count; };
  ASSERT_TRUE(test::await([&] { return count() == 1; }));

  auto client = gvd::ConfigurationClient::open(node_, url_);
  ASSERT_TRUE(client) << client.error().text();
  const auto before = client->list();
  ASSERT_TRUE(before);
  ASSERT_TRUE(client->apply(
      before->revision, {{"safety.force_newton_max", 2.5}, {"label", std::string("left arm")}}));
  auto reports = device::ConfigurationChangedSupplier::create(hub_->hub(), gvd::source_of(url_));
  ASSERT_TRUE(reports) << reports.error().text();
  flatbuffers::FlatBufferBuilder change;
  const auto names = change.CreateVectorOfStrings(std::vector<std::string>{"label"});
  change.Finish(device::CreateConfigurationChanged(change, before->revision + 1, names));
  ASSERT_TRUE(reports->push(change));
  // The event itself, and the parameters.
  ASSERT_TRUE(test::await([&] { return count() >= 3; }));
  ASSERT_TRUE(recording->stop());

  const auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader) << reader.error().text();
  const auto read = read_parameters(**reader);
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->size(), 1u);
  const RecordedParameters& recorded = read->front();
  EXPECT_EQ(recorded.device, url_);
  EXPECT_EQ(recorded.first.serial, "t-1");
  EXPECT_EQ(recorded.first.parameters.size(), device_.specs.size());
  EXPECT_EQ(recorded.first.find("safety.force_newton_max")->value, driver::ParameterValue(9.0));
  EXPECT_EQ(recorded.first.find("safety.force_newton_max")->spec.unit, "newton");
  EXPECT_EQ(recorded.last.find("label")->value, driver::ParameterValue(std::string("left arm")));
  ASSERT_EQ(recorded.changes.size(), 1u);
  EXPECT_EQ(recorded.changes[0].settings.size(), 2u) << "only what has changed";
  EXPECT_GT(recorded.changes[0].time_ns, (*reader)->statistics().begin_ns);

  const auto metadata = (*reader)->read_metadata();
  ASSERT_TRUE(metadata);
  EXPECT_EQ(session_of(*metadata), kSession);
  const auto versions = std::ranges::find(*metadata, kVersionsMetadata, &recording::Metadata::name);
  ASSERT_NE(versions, metadata->end());
  for (const char* const name : {"rtpm", "host", "kernel"})
    EXPECT_FALSE(versions->values.at(name).empty()) << name;
}

/// Two devices at the registry; only one pushes events to the recording's hub.
TEST_F(SessionTest, HasTheParametersOfTheDevicesThatItRecordsOnly) {
  const auto names = names::make_servant();
  const auto registry = test::serve(names::kRegistryPath, *names);
  const std::string registry_url = registry->url(names::kRegistryPath);
  names::RegistryResolver resolver(node_, registry_url);
  node_.use(resolver);
  for (const char* const name : {"lab/arm0", "lab/arm1"}) {
    const auto bound = names::Directory(node_, registry_url)
                           .bind({.name = name,
                                  .url = url_,
                                  .interface = device::DeviceClient::interface().name,
                                  .owner = {.id = 1, .epoch = 1},
                                  .lease = std::chrono::minutes{1}});
    ASSERT_TRUE(bound) << bound.error().text();
  }
  auto recording =
      LiveRecording::start(node_, file_, {.hub = hub_->url(), .registry = registry_url});
  ASSERT_TRUE(recording) << recording.error().text();
  auto samples = device::SampledSupplier::create(hub_->hub(), gvd::source_of("lab/arm0"));
  ASSERT_TRUE(samples) << samples.error().text();
  ASSERT_TRUE(samples->push(device::Sample{}));
  // The event itself, and the parameters.
  ASSERT_TRUE(test::await([&] { return (*recording)->status().recorder.message_count >= 2; }));
  ASSERT_TRUE((*recording)->stop());
  node_.forget(resolver);
  registry->stop();

  const auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader) << reader.error().text();
  const auto read = read_parameters(**reader);
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ(read->front().device, "lab/arm0");
  EXPECT_EQ(read->front().first.parameters.size(), device_.specs.size());
}

TEST_F(SessionTest, StatesWhoseParametersAreMissing) {
  auto recording = start("rtpm://127.0.0.1:1/arm9");
  ASSERT_NE(recording, nullptr);
  ASSERT_TRUE(test::await([&] { return !recording->status().reports.empty(); }));
  EXPECT_NE(recording->status().reports[0].find("arm9"), std::string::npos);
  ASSERT_TRUE(recording->stop());
  const auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader);
  const auto metadata = (*reader)->read_metadata();
  ASSERT_TRUE(metadata);
  const auto missing =
      std::ranges::find(*metadata, kMissingParametersMetadata, &recording::Metadata::name);
  ASSERT_NE(missing, metadata->end());
  EXPECT_TRUE(missing->values.contains("rtpm://127.0.0.1:1/arm9"));
}

TEST_F(SessionTest, LeavesNoFileIfATopicIsUnknown) {
  const auto started =
      LiveRecording::start(node_, file_, {.hub = hub_->url(), .topics = {"lab.Tuched"}});
  ASSERT_FALSE(started);
  EXPECT_NE(started.error().text().find("lab.Tuched"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(file_));
}

}  // namespace
}  // namespace rtpm::capture
