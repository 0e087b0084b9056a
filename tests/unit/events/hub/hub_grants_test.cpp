#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "rtpm/access/files.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "served_hub.hpp"

// A hub whose server checks grants: each event needs those for the path of its type and source.
namespace rtpm::events::test {
namespace {

/// A hub that one server serves to all users, and another one by grants, here to this user.
class GrantedHub : public testing::Test {
 protected:
  void serve(std::initializer_list<std::string> grants) {
    std::ofstream file(folder_ + "/authorized");
    for (const std::string& grant : grants)
      file << "uid:" << access::this_user() << " " << grant << "\n";
    file.close();
    rpc::ServerConfig config = server_config_for({});
    config.port = 0;
    config.security = {.authorized_file = folder_ + "/authorized", .key_file = folder_ + "/key"};
    server_ = rtpm::test::serve(kHubPath, open_.hub().servant(), config,
                                rpc::ObjectOptions{.checks_callers = true});
  }
  [[nodiscard]] std::string url() const { return server_->url(kHubPath); }
  [[nodiscard]] auto consume(const Filter& filter) {
    return Consumer::create(node_, url(),
                            {.filter = filter,
                             .realtime = rt::RealtimeMode::kOff,
                             .transport = rpc::Transport::kSharedMemory,
                             .deadline = kPatience},
                            recorder_);
  }

  rtpm::test::TemporaryFolder temporary_;
  std::string folder_ = temporary_.path();
  ServedHub open_{};
  std::unique_ptr<rpc::Server> server_;
  rpc::Node node_{{.collocates = false}};
  Recorder recorder_{};
};

TEST_F(GrantedHub, AcceptsOnlyEventsThatTheSupplierMayCommand) {
  serve({"role=command on=rtpm/events/" + std::to_string(kPose),
         "role=command on=rtpm/events/" + std::to_string(kButton) + "/2",
         "role=observe on=rtpm/events/" + std::to_string(kGaze) + "/**"});
  const auto consumer = make_consumer(node_, open_, recorder_, everything());
  const auto supplier =
      Supplier::create(node_, url(), {.transport = rpc::Transport::kTcp, .deadline = kPatience});
  EXPECT_FALSE(supplier) << "a session that is not sealed is nobody's";
  const auto trusted = rtpm::test::made(Supplier::create(
      node_, url(), {.transport = rpc::Transport::kSharedMemory, .deadline = kPatience}));
  for (const EventHeader& header :
       {EventHeader{.type = kGaze, .source = 1}, EventHeader{.type = kButton, .source = 1},
        EventHeader{.type = kButton, .source = 2}, EventHeader{.type = kPose, .source = 3}}) {
    static_cast<void>(trusted->push({.type = header.type, .source = header.source}));
  }
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "6.2#1 5.3#1");
}

TEST_F(GrantedHub, DeliversOnlyEventsThatTheConsumerMayObserve) {
  serve({"role=observe on=rtpm/events/" + std::to_string(kGaze) + "/**",
         "role=observe on=rtpm/events/" + std::to_string(kButton) + "/2"});
  const auto all = consume(everything());
  ASSERT_FALSE(all);
  rtpm::test::expect_text(all.error().text(), {"role observe on rtpm/events/TYPE"});
  EXPECT_FALSE(consume(of_type(kPose)));
  EXPECT_FALSE(consume(any_of({of_type(kGaze), of_type(kPose)})));
  EXPECT_FALSE(consume(of_type(kButton)));
  EXPECT_TRUE(consume(of_type(kButton, 2)));
  const auto consumer = consume(of_type(kGaze));
  ASSERT_TRUE(consumer) << consumer.error().text();
  const auto supplier = make_supplier(node_, open_);
  push(*supplier, kPose);
  push(*supplier, kGaze);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "7.0#1");
}

}  // namespace
}  // namespace rtpm::events::test
