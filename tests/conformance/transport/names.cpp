#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "suite.hpp"

// Bindings by name, whose servers come back at another address.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kName = "lab/echo";

/// Names as in a registry, which the test changes.
class NameTable final : public Resolver {
 public:
  explicit NameTable(std::string url) { lead_to(std::move(url)); }
  expected<std::string, SetupError> resolve(std::string_view name, MonotonicTime) override {
    const std::lock_guard lock(mutex_);
    looks_.push_back(rt::now());
    if (name == kName && !url_.empty()) return url_;
    return setup_error("name '" + std::string(name) + "' is not bound");
  }
  /// Sets the name's URL; empty unbinds the name.
  void lead_to(std::string url) {
    const std::lock_guard lock(mutex_);
    url_ = std::move(url);
  }
  [[nodiscard]] std::vector<MonotonicTime> looks() {
    const std::lock_guard lock(mutex_);
    return looks_;
  }

 private:
  std::mutex mutex_;
  std::string url_;
  std::vector<MonotonicTime> looks_;
};

/// A servant of another interface.
class OtherServant final : public Servant {
 public:
  explicit OtherServant(InterfaceDescriptor interface) : interface_(interface) {}
  const InterfaceDescriptor& interface() const noexcept override { return interface_; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes, const CallContext&) override {
    ++run_count;
    return {};
  }
  std::atomic<int> run_count{0};

 private:
  InterfaceDescriptor interface_;
};

/// The errors that a caller of a vanished server may get.
[[nodiscard]] bool is_of_an_outage(CallError error) {
  return error == CallError::kUnreachable || error == CallError::kDisconnected ||
         error == CallError::kPeerRestarted || error == CallError::kStopped;
}

/// A server that is found by its name.
class NameSuite : public LosslessSuite {
 protected:
  void SetUp() override {
    LosslessSuite::SetUp();
    first_.emplace();
    table_.emplace(first_->url());
    node_.emplace(node_config());
    node_->use(*table_);
  }
  void TearDown() override {
    node_.reset();
    LosslessSuite::TearDown();
  }

  [[nodiscard]] Binding bind(BindOptions options = {}) {
    options.deadline = rtpm::test::kPatience;
    auto bound = Binding::bind(*node_, kName, echo::kInterface, options);
    EXPECT_TRUE(bound) << bound.error().text();
    return std::move(*bound);
  }
  /// Ends the first server; from now on the name leads to `url`.
  void move_to(std::string url) {
    first_.reset();
    table_->lead_to(std::move(url));
  }
  /// Calls until one succeeds; all errors before are those of an outage.
  [[nodiscard]] bool call_until_it_comes_through(Binding& binding,
                                                 const MethodDescriptor& method = echo::kEcho) {
    return await([&] {
      const auto reply = binding.call(method, bytes_of("again"));
      if (!reply) {
        EXPECT_TRUE(is_of_an_outage(reply.error())) << to_string(reply.error());
        return false;
      }
      return text_of(*reply) == "again";
    });
  }
  /// Calls until one fails with `error`.
  [[nodiscard]] bool call_until_it_fails_with(Binding& binding, CallError error) {
    return await([&] {
      const auto reply = binding.call(echo::kEcho, {});
      EXPECT_FALSE(reply);
      return !reply && reply.error() == error;
    });
  }

  std::optional<EchoServer> first_;
  std::optional<NameTable> table_;
  std::optional<Node> node_;
};

INSTANTIATE_TEST_SUITE_P(Udp, NameSuite, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, NameSuite, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, NameSuite, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Local, NameSuite, testing::Values(Transport::kLocal));

}  // namespace

TEST_P(NameSuite, GoesOnWithAServerThatCameBackAtAnotherPort) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  const Transport transport = binding.transport();
  EchoServer second;
  move_to(second.url());
  ASSERT_TRUE(call_until_it_comes_through(binding));
  EXPECT_EQ(binding.url(), second.url());
  EXPECT_EQ(binding.transport(), transport);
  EXPECT_EQ(second.servant.run_count(), 1);
  const FollowStatus status = binding.follow_status();
  EXPECT_EQ(status.move_count, 1u);
  EXPECT_GE(status.resolve_count, 1u);
  EXPECT_EQ(status.trouble, "");
}

// The binding recovers without further calls: the first call of the outage is enough.
TEST_P(NameSuite, FindsTheServerWithoutFurtherCalls) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  move_to("");
  expect_error(binding.call(echo::kEcho, {}), CallError::kUnreachable);
  ASSERT_TRUE(await([&] { return table_->looks().size() >= 2; })) << "one was the bind's";
  EchoServer second;
  table_->lead_to(second.url());
  ASSERT_TRUE(await([&] { return binding.follow_status().move_count == 1; }));
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
}

// The name leads to the second server before the first one ends, so that the first look-up of the
// outage finds it; a look-up that finds the first one again is retried only after seconds.
TEST_P(NameSuite, RunsNoCallTwiceWhileItsServerMoves) {
  Binding binding = bind();
  EchoServer second;
  std::atomic<int> success_count{0};
  std::atomic<bool> is_over{false};
  std::vector<std::thread> callers;
  for (int i = 0; i < 3; ++i) {
    callers.emplace_back([&] {
      while (!is_over) {
        if (binding.call(echo::kEchoOnce, {})) {
          ++success_count;
        } else {
          // Leaves the CPU to the thread that looks the name up.
          rt::sleep_until(rt::now() + 1ms);
        }
      }
    });
  }
  EXPECT_TRUE(await([&] { return success_count > 10; }));
  table_->lead_to(second.url());
  first_->server->stop();
  const int first_count = first_->servant.run_count();
  first_.reset();
  EXPECT_TRUE(await([&] { return second.servant.run_count() > 100; }, 60s));
  is_over = true;
  for (std::thread& caller : callers)
    caller.join();
  EXPECT_LE(success_count, first_count + second.servant.run_count());
  EXPECT_GE(success_count, second.servant.run_count()) << "each that ran there had its reply";
}

TEST_P(NameSuite, MovesBegunCallsToTheNewAddress) {
  Binding binding = bind();
  const auto begin_and_take = [&] {
    auto begun = binding.begin(echo::kEcho, bytes_of("begun"));
    if (!begun) return false;
    const auto reply = begun->take();
    return reply && text_of(*reply) == "begun";
  };
  ASSERT_TRUE(begin_and_take());
  EchoServer second;
  move_to(second.url());
  EXPECT_TRUE(await(begin_and_take));
  EXPECT_EQ(binding.url(), second.url());
}

TEST_P(NameSuite, ReportsThatTheNameLeadsToAnotherInterface) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  OtherServant other({"lab.Other", 1, "by hand", {}});
  auto server = std::move(*Server::create(quiet_config()));
  ASSERT_TRUE(server->add("echo", other));
  ASSERT_TRUE(server->start());
  move_to(server->url("echo"));
  EXPECT_TRUE(call_until_it_fails_with(binding, CallError::kWrongInterface));
  const std::string trouble = binding.follow_status().trouble;
  for (const std::string& part :
       {std::string("'lab/echo' leads to ") + server->url("echo"),
        std::string("is a lab.Other, not a test.Echo"), std::string("Remedy")}) {
    EXPECT_NE(trouble.find(part), std::string::npos) << part << " is not in: " << trouble;
  }
  EXPECT_EQ(other.run_count, 0);
  // The right server is found later.
  EchoServer second;
  table_->lead_to(second.url());
  EXPECT_TRUE(await([&] { return binding.call(echo::kEcho, {}).has_value(); }));
  server->stop();
}

TEST_P(NameSuite, ReportsThatTheNameLeadsToAnotherVersion) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  auto methods = echo::kMethods;
  methods[0].fingerprint ^= 1;
  OtherServant other({"test.Echo", 4712, "by hand", methods});
  auto server = std::move(*Server::create(quiet_config()));
  ASSERT_TRUE(server->add("echo", other));
  ASSERT_TRUE(server->start());
  move_to(server->url("echo"));
  EXPECT_TRUE(call_until_it_fails_with(binding, CallError::kNoSuchMethod));
  EXPECT_NE(binding.follow_status().trouble.find("method 'echo' (id 1)"), std::string::npos);
  EXPECT_EQ(other.run_count, 0);
  server->stop();
}

TEST_P(NameSuite, ReportsThatTheNameIsGone) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  move_to("");
  ASSERT_TRUE(await([&] {
    expect_error(binding.call(echo::kEcho, {}), CallError::kUnreachable);
    return binding.follow_status().resolve_count >= 1;
  }));
  EXPECT_EQ(binding.follow_status().trouble, "name 'lab/echo' is not bound.");
  EXPECT_EQ(binding.follow_status().move_count, 0u);
}

// Another server has the address now, and also has the object: the name decides.
TEST_P(NameSuite, LeavesAnAddressThatAnotherServerHasTaken) {
  Binding binding = bind();
  ASSERT_TRUE(binding.call(echo::kEcho, {}));
  ServerConfig config = quiet_config();
  config.port = first_->server->port();
  EchoServer second;
  move_to(second.url());
  EchoServer stranger(config);
  ASSERT_TRUE(await([&] {
    static_cast<void>(binding.call(echo::kEcho, {}));
    return second.servant.run_count() > 0;
  }));
  EXPECT_EQ(binding.url(), second.url());
}

TEST_P(NameSuite, ResolvesANameAtMostOnceASecondForAllItsBindings) {
  std::vector<Binding> bindings;
  for (int i = 0; i < 3; ++i)
    bindings.push_back(bind());
  const std::size_t bind_count = table_->looks().size();
  EXPECT_EQ(bind_count, 3u);
  move_to("");
  // Three look-ups take more than a second and two: the waits are 1 s, 2 s, then 4 s.
  ASSERT_TRUE(await([&] {
    for (Binding& binding : bindings)
      EXPECT_FALSE(binding.call(echo::kEcho, {}));
    return table_->looks().size() >= bind_count + 3;
  }));
  const std::vector<MonotonicTime> looks = table_->looks();
  EXPECT_GE(looks[bind_count + 1] - looks[bind_count], 1s);
  EXPECT_GE(looks[bind_count + 2] - looks[bind_count + 1], 2s);
  for (Binding& binding : bindings)
    EXPECT_LE(binding.follow_status().resolve_count, table_->looks().size() - bind_count);
}

// Programs end in this order: the resolver first, then its bindings, then the node.
TEST_P(NameSuite, OutlivesItsResolver) {
  Binding binding = bind();
  move_to("");
  EXPECT_FALSE(binding.call(echo::kEcho, {}));
  node_->forget(*table_);
  table_.reset();
  EXPECT_FALSE(binding.call(echo::kEcho, {}));
}

// The bind, too, keeps its own deadline.
TEST_P(NameSuite, EndsWithItsBindingsInMidOutage) {
  {
    Binding binding = bind();
    Binding other = bind({.is_private = true});
    move_to("");
    EXPECT_FALSE(binding.call(echo::kEcho, {}));
    EXPECT_FALSE(other.call(echo::kEcho, {}));
  }
  node_.reset();
}

}  // namespace rtpm::rpc::test
