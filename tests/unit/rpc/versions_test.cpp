#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>

#include "model/object_table.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/serve.hpp"
#include "rtpm/wire/control.hpp"

// Clients and servers of two versions of an interface.
namespace rtpm::rpc {
namespace {

using namespace test;

/// An interface of version `text` with one method, which returns its request.
struct Version {
  Version(std::string_view text, std::uint32_t number)
      : methods{{{.id = 1, .name = "get", .fingerprint = number}}}, interface {
    .name = "test.Versions", .fingerprint = number, .compiler_version = "0", .methods = methods,
    .text = text
  } {
  }
  Version(const Version&) = delete;
  Version& operator=(const Version&) = delete;

  std::array<MethodDescriptor, 1> methods;
  InterfaceDescriptor interface;
};

#define RTPM_TEST_TEXT(FIELDS)                                    \
  "service test.Versions\nmethod 1 get\nrequest table test.Ask\n" \
  "reply table test.Ask\ntable test.Ask {\n" FIELDS "}\n"

const Version kOld{RTPM_TEST_TEXT("  0 a: int32 = 0\n"), 1};
const Version kNew{RTPM_TEST_TEXT("  0 a: int32 = 0\n  1 b: string optional\n"), 2};
const Version kOther{RTPM_TEST_TEXT("  0 a: double = 0\n"), 3};
const Version kSilent{"", 4};

class VersionServant final : public Servant {
 public:
  explicit VersionServant(const Version& version) : version_(version) {}
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override {
    return version_.interface;
  }
  DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes reply,
                          const CallContext&) override {
    std::ranges::copy(request, reply.begin());
    return {wire::Status::kOk, static_cast<std::uint32_t>(request.size())};
  }

 private:
  const Version& version_;
};

struct VersionServer {
  explicit VersionServer(const Version& version, std::uint16_t port = 0) : servant(version) {
    ServerConfig config = quiet_config();
    config.port = port;
    server = rtpm::test::serve("versions", servant, std::move(config));
  }
  ~VersionServer() { server->stop(); }
  VersionServer(const VersionServer&) = delete;
  VersionServer& operator=(const VersionServer&) = delete;

  VersionServant servant;
  std::unique_ptr<Server> server;
};

class Versions : public testing::TestWithParam<Transport> {
 protected:
  expected<Binding, SetupError> bind(const VersionServer& server, const Version& version) {
    return Binding::bind(node_, server.server->url("versions"), version.interface,
                         {.deadline = rtpm::test::kPatience});
  }
  static std::string text_of_call(Binding& binding, const Version& version) {
    const auto reply = binding.call(version.methods.front(), bytes_of("hello"));
    return reply ? text_of(*reply) : std::string(to_string(reply.error()));
  }
  Node node_{quiet_node(GetParam())};
};

INSTANTIATE_TEST_SUITE_P(Transports, Versions,
                         testing::Values(Transport::kUdp, Transport::kTcp,
                                         Transport::kSharedMemory),
                         [](const auto& row) { return std::string(to_string(row.param)); });

// hp-6.1-2
TEST_P(Versions, BindIfTheyAreCompatible) {
  for (const auto& [client, server] : {std::pair{&kOld, &kNew}, {&kNew, &kOld}, {&kNew, &kNew}}) {
    const VersionServer serving(*server);
    auto binding = bind(serving, *client);
    ASSERT_TRUE(binding) << binding.error().text();
    EXPECT_EQ(text_of_call(*binding, *client), "hello");
  }
}

// hp-6.1-2
TEST_P(Versions, ReportTheirDifference) {
  const VersionServer server(kOther);
  const auto binding = bind(server, kOld);
  ASSERT_FALSE(binding);
  expect_text(binding.error().text(),
              {"another test.Versions", "method 'get' (id 1)", "field 0 of `table test.Ask`",
               "`0 a: double = 0` there", "`0 a: int32 = 0` here", "Remedy"});
}

// hp-6.1-2: unless both sides have a text, only equal fingerprints will do.
TEST_P(Versions, MustBeEqualWithoutAText) {
  const VersionServer server(kSilent);
  const auto newer = bind(server, kNew);
  ASSERT_FALSE(newer);
  expect_text(newer.error().text(), {"method 'get' (id 1) is missing or differs there"});
  EXPECT_TRUE(bind(server, kSilent));
  const VersionServer telling(kNew);
  EXPECT_FALSE(bind(telling, kSilent));
}

// hp-6.1-6: fingerprint 0 says nothing, so that the methods decide.
TEST_P(Versions, AreComparedByMethodsWithoutAFingerprint) {
  Version server_side{"", 5};
  server_side.interface.fingerprint = 0;
  Version same{"", 5};
  same.interface.fingerprint = 0;
  Version other{"", 6};
  other.interface.fingerprint = 0;
  const VersionServer server(server_side);
  EXPECT_TRUE(bind(server, same));
  EXPECT_TRUE(bind(server, Version{"", 5}));
  const auto refused = bind(server, other);
  ASSERT_FALSE(refused);
  expect_text(refused.error().text(), {"method 'get' (id 1) is missing or differs there"});
}

// hp-6.1-6
TEST_P(Versions, AreNotCheckedByTheServer) {
  VersionServant servant(kNew);
  ObjectTable objects;
  ASSERT_TRUE(objects.add("versions", servant, {}, Priority::kHighest));
  for (const std::uint64_t fingerprint : {std::uint64_t{0}, std::uint64_t{2}, ~std::uint64_t{0}}) {
    std::array<std::byte, 256> request{};
    const std::size_t size =
        encode(wire::BindRequest{"versions", "test.Versions", fingerprint}, MutableBytes(request));
    std::array<std::byte, 256> reply{};
    EXPECT_EQ(objects.bind(ConstBytes(request).first(size), reply).status, wire::Status::kOk);
  }
}

// hp-6.1-4: a restarted server may have another version.
TEST_P(Versions, MayChangeOverARestart) {
  auto server = std::make_unique<VersionServer>(kOld);
  const std::uint16_t port = server->server->port();
  auto binding = bind(*server, kOld);
  ASSERT_TRUE(binding) << binding.error().text();
  EXPECT_EQ(text_of_call(*binding, kOld), "hello");
  const auto restart = [&](const Version& version) {
    server.reset();
    server = std::make_unique<VersionServer>(version, port);
    // The first call may still use the session with the server before its restart.
    std::string text;
    EXPECT_TRUE(await([&] {
      text = text_of_call(*binding, kOld);
      return text == "hello" || text == to_string(CallError::kNoSuchMethod);
    })) << text;
    return text;
  };
  EXPECT_EQ(restart(kNew), "hello");
  EXPECT_EQ(restart(kOther), to_string(CallError::kNoSuchMethod));
  EXPECT_EQ(restart(kNew), "hello");
}

// hp-6.3-1
TEST(Describe, ReturnsTheTextOrAnError) {
  VersionServant telling(kOld);
  VersionServant silent(kSilent);
  ObjectTable objects;
  ASSERT_TRUE(objects.add("telling", telling, {}, Priority{32767}));
  ASSERT_TRUE(objects.add("silent", silent, {}, Priority{32767}));
  std::array<std::byte, 512> reply{};
  const auto ask = [&](std::uint32_t service, std::size_t capacity) {
    std::array<std::byte, wire::kDescribeRequestSize> request{};
    wire::encode_describe_request(service, request);
    return objects.describe(request, MutableBytes(reply).first(capacity));
  };
  const std::string_view text = kOld.interface.text;
  const DispatchResult described = ask(1, text.size());
  EXPECT_EQ(described.status, wire::Status::kOk);
  ASSERT_EQ(described.reply_size, text.size());
  EXPECT_TRUE(std::ranges::equal(ConstBytes(reply).first(text.size()), bytes_of(text)));
  EXPECT_EQ(ask(1, text.size() - 1).status, wire::Status::kTooLarge);
  EXPECT_EQ(ask(2, reply.size()).status, wire::Status::kNoSuchMethod);
  EXPECT_EQ(ask(3, reply.size()).status, wire::Status::kNoSuchObject);
  EXPECT_EQ(ask(0, reply.size()).status, wire::Status::kNoSuchObject);
  EXPECT_EQ(objects.describe(bytes_of("123"), reply).status, wire::Status::kBadRequest);
  EXPECT_EQ(objects.describe(bytes_of("12345"), reply).status, wire::Status::kBadRequest);
}

}  // namespace
}  // namespace rtpm::rpc
