#include "rtpm/events/hub_server.hpp"

#include <gtest/gtest.h>

#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/names/servant.hpp"
#include "served_hub.hpp"

// A hub in a program, found by its name.
namespace rtpm::events::test {
namespace {

class EmbeddedHub : public testing::Test {
 protected:
  void SetUp() override {
    registry_ = rtpm::test::serve("rtpm/names", *names_);
    url_ = registry_->url("rtpm/names");
    resolver_.emplace(node_, url_);
    node_.use(*resolver_);
  }
  void TearDown() override { registry_->stop(); }
  [[nodiscard]] HubServerConfig config(const std::string& name) const {
    HubServerConfig config{.name = name, .registry = url_};
    config.hub.realtime = rt::RealtimeMode::kOff;
    config.hub.priority.reset();
    config.server = server_config_for(config.hub);
    config.server->realtime = rt::RealtimeMode::kOff;
    return config;
  }

  std::unique_ptr<rpc::Servant> names_ = names::make_servant();
  std::unique_ptr<rpc::Server> registry_{};
  std::string url_{};
  rpc::Node node_{};
  std::optional<names::RegistryResolver> resolver_{};
  Recorder recorder_{};
};

TEST_F(EmbeddedHub, IsFoundByItsNameUntilItEnds) {
  auto served = HubServer::create(node_, config("lab/events"));
  ASSERT_TRUE(served) << served.error().text();
  const auto consumer = rtpm::test::made(Consumer::create(
      node_, "lab/events", {.realtime = rt::RealtimeMode::kOff, .deadline = kPatience}, recorder_));
  const auto supplier = rtpm::test::made(Supplier::create((*served)->hub()));
  push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  served->reset();
  EXPECT_FALSE(resolver_->resolve("lab/events", kNever));
}

TEST_F(EmbeddedHub, NeedsNoName) {
  const auto served = rtpm::test::made(HubServer::create(node_, config("")));
  const auto consumer = rtpm::test::made(
      Consumer::create(node_, served->url(),
                       {.realtime = rt::RealtimeMode::kOff, .deadline = kPatience}, recorder_));
  EXPECT_TRUE(consumer);
}

TEST_F(EmbeddedHub, ReportsWhyItsNameWasRefused) {
  const auto served = HubServer::create(node_, config("not//a name"));
  ASSERT_FALSE(served);
  EXPECT_FALSE(served.error().text().empty());
}

TEST_F(EmbeddedHub, ListsTheTypesOfItsSuppliers) {
  static constexpr EventDescriptor kPoseType{kPose, "lab.Pose", kPoseSchema, kPoseFields,
                                             "namespace lab; table Pose {}"};
  const std::string long_schema(17 * 1024, ' ');
  const EventDescriptor gaze_type{kGaze, "lab.Gaze", 3, {}, long_schema};
  const auto served = rtpm::test::made(HubServer::create(node_, config("lab/events")));
  const auto none = HubTypes::ask(node_, "lab/events");
  ASSERT_TRUE(none) << none.error().text();
  EXPECT_TRUE(none->list().empty());
  const auto supplier = rtpm::test::made(
      Supplier::create(node_, "lab/events", {.name = "arm", .types = {&kPoseType, &gaze_type}}));
  const auto types = HubTypes::ask(node_, "lab/events");
  ASSERT_TRUE(types) << types.error().text();
  ASSERT_EQ(types->list().size(), 2u);
  EXPECT_EQ(types->find(kGaze)->schema, "") << "it is too long to be kept";
  const EventDescriptor* const pose = types->find(kPose);
  ASSERT_NE(pose, nullptr);
  EXPECT_EQ(pose->name, "lab.Pose");
  EXPECT_EQ(pose->schema_id, kPoseSchema);
  EXPECT_EQ(pose->schema, kPoseType.schema);
  ASSERT_EQ(pose->fields.size(), kPoseFields.size());
  EXPECT_EQ(pose->fields[1].name, "force");
  EXPECT_EQ(pose->fields[1].path, kPoseFields[1].path);
}

TEST_F(EmbeddedHub, ReportsThatNoHubHasTheName) {
  const auto types = HubTypes::ask(node_, "lab/events");
  ASSERT_FALSE(types);
  rtpm::test::expect_text(types.error().text(), {"lab/events"});
}

}  // namespace
}  // namespace rtpm::events::test
