#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "client/node_impl.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/free_port.hpp"
#include "rtpm/test/serve.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/limits.hpp"

// The error texts of failed bindings.
namespace rtpm::rpc {
namespace {

using rtpm::test::free_port;

using namespace test;
using namespace std::chrono_literals;

std::string error_of(Node& node, const std::string& target,
                     const InterfaceDescriptor& interface = echo::kInterface,
                     Duration deadline = rtpm::test::kPatience) {
  const auto bound = Binding::bind(node, target, interface, {.deadline = deadline});
  return bound ? "" : bound.error().text();
}

class BindErrors : public testing::TestWithParam<Transport> {
 protected:
  Node node_{quiet_node(GetParam())};
};

INSTANTIATE_TEST_SUITE_P(Transports, BindErrors,
                         testing::Values(Transport::kUdp, Transport::kTcp,
                                         Transport::kSharedMemory),
                         [](const auto& row) { return std::string(to_string(row.param)); });

TEST_P(BindErrors, NameAnInvalidUrl) {
  expect_text(error_of(node_, "rtpm://127.0.0.1/echo"),
              {"'rtpm://127.0.0.1/echo'", "no RTPM URL", "Remedy", "rtpm://host:port/path"});
  expect_text(error_of(node_, "http://127.0.0.1:80/echo"), {"no RTPM URL", "Remedy"});
}

TEST_P(BindErrors, ReportANameWithoutAResolver) {
  expect_text(error_of(node_, "lab/arm0"), {"'lab/arm0'", "no registry", "Remedy", "Node::use"});
}

TEST_P(BindErrors, ReportThatNoServerAnswers) {
  const std::string port = std::to_string(free_port());
  std::string cause = "no server answers at the address";
  if (GetParam() == Transport::kTcp) cause = "no server answers at TCP 127.0.0.1:" + port;
  if (GetParam() == Transport::kSharedMemory) cause = "gives no shared memory";
  expect_text(error_of(node_, "rtpm://127.0.0.1:" + port + "/echo"),
              {"'echo'", "rtpm://127.0.0.1:" + port, cause});
}

// The client cannot know whether the server is there.
TEST_P(BindErrors, ReportThatNoDescriptorIsFree) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([this]() -> std::string {
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    const auto bound = Binding::bind(node_, "rtpm://127.0.0.1:4711/echo", echo::kInterface);
    if (bound) return "it is bound";
    if (bound.error().cause != CallError::kNoResources) return "another cause";
    return bound.error().text();
  });
  expect_text(child.said, {"'echo' can't be bound at rtpm://127.0.0.1:4711", "Too many open files",
                           "Remedy: raise the limit of open files"});
  EXPECT_EQ(child.status, 0) << child.errors;
}

TEST_P(BindErrors, ReportAHostWithoutAnAddress) {
  expect_text(error_of(node_, "rtpm://999.1.1.1:80/echo"),
              {"'rtpm://999.1.1.1:80/echo'", "host '999.1.1.1' has no address", "Remedy"});
}

TEST_P(BindErrors, AreAbsentForAHostName) {
  const EchoServer server;
  const std::string port = std::to_string(server.server->port());
  EXPECT_EQ(error_of(node_, "rtpm://localhost:" + port + "/echo"), "");
}

TEST_P(BindErrors, NameTheObjectsMostSimilarToAnUnknownOne) {
  echo::Servant servant;
  const auto server = std::move(*Server::create(quiet_config()));
  for (const char* path : {"lab/arm0", "lab/arm1", "rtpm/introspection", "lab/hand", "lab/arm2"})
    ASSERT_TRUE(server->add(path, servant));
  ASSERT_TRUE(server->start());
  expect_text(error_of(node_, server->url("lab/arm7")),
              {"no object 'lab/arm7'",
               "; most like it there: lab/arm0, lab/arm1, lab/arm2, "
               "lab/hand. Remedy"});
}

TEST_P(BindErrors, NameTheInterfaceOfTheObject) {
  const EchoServer server;
  InterfaceDescriptor other = echo::kInterface;
  other.name = "lab.Arm";
  expect_text(error_of(node_, server.url(), other),
              {"'echo'", "is a test.Echo", "not a lab.Arm", "Remedy"});
}

// hp-6.1-2
TEST_P(BindErrors, NameTheMethodThatDiffers) {
  const EchoServer server;
  auto methods = echo::kMethods;
  methods[3].fingerprint ^= 1;
  InterfaceDescriptor other = echo::kInterface;
  other.fingerprint ^= 1;
  other.methods = methods;
  expect_text(error_of(node_, server.url(), other),
              {"'echo'", "another test.Echo", "method 'fail' (id 4)", "Remedy", "same schema"});
}

// hp-6.1-2
TEST_P(BindErrors, NameTheMethodThatIsMissing) {
  const EchoServer server;
  std::vector<MethodDescriptor> methods(echo::kMethods.begin(), echo::kMethods.end());
  methods.push_back({77, "newest", 1, false, {}});
  InterfaceDescriptor newer = echo::kInterface;
  newer.fingerprint ^= 1;
  newer.methods = methods;
  expect_text(error_of(node_, server.url(), newer), {"method 'newest' (id 77)", "Remedy"});
}

// hp-6.1-2
TEST_P(BindErrors, AreAbsentIfTheServerHasMoreMethods) {
  const EchoServer server;
  InterfaceDescriptor older = echo::kInterface;
  older.fingerprint ^= 1;
  older.methods = older.methods.first(2);
  EXPECT_EQ(error_of(node_, server.url(), older), "");
}

TEST_P(BindErrors, ReportThatEveryChannelIsInUse) {
  const EchoServer server;
  NodeConfig config = quiet_node(GetParam());
  config.channel_count_max = 0;
  Node node(config);
  expect_text(error_of(node, server.url()), {"'echo'", "NodeConfig::channel_count_max"});
}

// A silent program occupies the port.
TEST(BindDeadline, EndsTheWaitForASilentServer) {
  const std::uint16_t port = free_port();
  const auto silent_udp = transport::UdpPort::open({.port = port});
  const auto silent_tcp = transport::TcpListener::open("127.0.0.1", port);
  ASSERT_TRUE(silent_udp);
  ASSERT_TRUE(silent_tcp);
  for (const Transport transport : {Transport::kUdp, Transport::kTcp}) {
    Node node(quiet_node(transport));
    const MonotonicTime begin = rt::now();
    const std::string url = "rtpm://127.0.0.1:" + std::to_string(port) + "/echo";
    expect_text(error_of(node, url, echo::kInterface, 20ms),
                {"'echo'", std::to_string(port), "no reply came within the deadline"});
    EXPECT_GE(rt::now() - begin, Duration{20ms});
  }
}

// hp-4-6: the server speaks another version and says so.
TEST(BindHandshake, ReportsDifferentVersions) {
  const std::uint16_t number = free_port();
  auto port = transport::UdpPort::open({.port = number});
  ASSERT_TRUE(port);
  std::thread stranger([&] {
    Bytes buffer(2000);
    ASSERT_TRUE(transport::wait_readable(port->descriptor(), rt::now() + rtpm::test::kPatience));
    const auto hello = port->receive(buffer);
    ASSERT_TRUE(hello);
    wire::Header refusal = *wire::decode_frame(hello->bytes());
    refusal.kind = wire::FrameKind::kRefuse;
    refusal.status = wire::Status::kVersionUnsupported;
    refusal.payload_size = refusal.message_size = 0;
    Bytes frame(wire::kHeaderSize);
    wire::encode(refusal, frame.data());
    EXPECT_TRUE(port->send(hello->peer(), frame));
  });
  Node node(quiet_node());
  expect_text(error_of(node, "rtpm://127.0.0.1:" + std::to_string(number) + "/echo"),
              {"no protocol version in common", "update"});
  stranger.join();
}

/// A resolver that knows one name.
class OneName final : public Resolver {
 public:
  explicit OneName(std::string url) : url_(std::move(url)) {}
  expected<std::string, SetupError> resolve(std::string_view name, MonotonicTime) override {
    if (name == "lab/echo") return url_;
    return setup_error("name '" + std::string(name) + "' is not bound. Remedy: start its server.");
  }

 private:
  std::string url_;
};

TEST(BindByName, UsesTheResolver) {
  const EchoServer server;
  OneName resolver(server.url());
  Node node(quiet_node());
  node.use(resolver);
  auto bound = Binding::bind(node, "lab/echo", echo::kInterface);
  ASSERT_TRUE(bound) << bound.error().text();
  EXPECT_EQ(bound->url(), server.url());
  EXPECT_EQ(error_of(node, "lab/other"),
            "name 'lab/other' is not bound. Remedy: start its server.");
}

TEST(BindByName, ReportsAnInvalidUrlOfTheResolver) {
  OneName resolver("nonsense");
  Node node(quiet_node());
  node.use(resolver);
  expect_text(error_of(node, "lab/echo"), {"'nonsense'", "no RTPM URL", "Remedy"});
}

// Servers come and go at their own ports; a node keeps a bounded number of their endpoints.
TEST(BindEndpoints, OfStoppedServersAreReleased) {
  Node node(quiet_node(Transport::kTcp));
  constexpr std::size_t kServerCount = 3 * Node::Impl::kUnusedEndpointMax;
  const EchoServer lasting;
  Binding stays = bind_echo(node, lasting);
  for (std::size_t i = 0; i < kServerCount; ++i) {
    const EchoServer server;
    Binding binding = bind_echo(node, server, {.is_private = i % 2 == 0});
    ASSERT_TRUE(binding.call(echo::kEcho, {}));
  }
  EXPECT_LE(node.impl().endpoint_count(), Node::Impl::kUnusedEndpointMax + 1);
  EXPECT_TRUE(stays.call(echo::kEcho, {}));
}

// A server that is bound again soon needs no new session.
TEST(BindEndpoints, KeepTheirSessionsBetweenBindings) {
  const EchoServer server;
  Node node(quiet_node());
  const auto session_of = [&] {
    Binding binding = bind_echo(node, server);
    return place_of(binding).session;
  };
  const auto session = session_of();
  EXPECT_EQ(session_of(), session);
}

/// A servant whose interface has too many methods for a list in one datagram.
class LargeServant final : public Servant {
 public:
  explicit LargeServant(std::span<const MethodDescriptor> methods)
      : descriptor_{"test.Large", 1, "by hand", methods} {}
  const InterfaceDescriptor& interface() const noexcept override { return descriptor_; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes, const CallContext&) override {
    return {};
  }

 private:
  InterfaceDescriptor descriptor_;
};

// The client trusts that methods beyond the list exist; a call shows whether they do.
TEST(BindMethodList, MayBeShorterThanTheInterface) {
  std::vector<MethodDescriptor> methods;
  for (std::uint16_t id = 1; id <= 400; ++id)
    methods.push_back({id, "method", id, false, {}});
  LargeServant servant(methods);
  const auto server = rtpm::test::serve("large", servant, quiet_config());
  Node node(quiet_node());
  std::vector<MethodDescriptor> older(methods.begin(), methods.end() - 1);
  const auto error_of_bind = [&] {
    return error_of(node, server->url("large"), {"test.Large", 2, "by hand", older});
  };
  EXPECT_EQ(error_of_bind(), "");
  older[5].fingerprint ^= 1;
  expect_text(error_of_bind(), {"method 'method' (id 6)"});
  server->stop();
}

TEST(CallErrors, HaveDistinctTexts) {
  std::set<std::string_view> texts;
  constexpr int kLast = static_cast<int>(CallError::kNotAllowed);
  for (int error = 0; error <= kLast; ++error) {
    const std::string_view text = to_string(static_cast<CallError>(error));
    EXPECT_FALSE(text.empty());
    EXPECT_NE(text, "unknown error");
    texts.insert(text);
  }
  EXPECT_EQ(texts.size(), static_cast<std::size_t>(kLast) + 1) << "each in its own words";
  EXPECT_EQ(to_string(static_cast<CallError>(kLast + 1)), "unknown error");
}

}  // namespace
}  // namespace rtpm::rpc
