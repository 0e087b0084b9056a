#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "rtpm/access/grants.hpp"
#include "rtpm/test/sealed_peer.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/socket.hpp"
#include "secured_server.hpp"
#include "security/call_origin.hpp"

// Permissions over every transport: identities × lines of `authorized` × objects × methods × ways
// to call. A model that knows only the lines predicts the result of each call.
namespace rtpm::rpc {
namespace {

using namespace test;
using vault::kMethods;

const std::vector<std::string> kPaths{"lab/arm0", "lab/arm1", "lab/cam/left", "public/clock",
                                      "arm"};
const std::vector<std::string> kPatterns{"lab/arm0",     "lab/*", "lab/**", "**",
                                         "public/clock", "*/*",   "**/left"};
constexpr std::array kRoles{Role::kObserve, Role::kCommand, Role::kConfigure, Role::kAdminister};
constexpr std::array kRoleNames{"observe", "command", "configure", "administer"};
constexpr uid_t kOtherUser = 12345;

// --- The model ---

struct Line {
  std::string identity;
  std::size_t role = 0;  ///< The index in kRoles.
  std::string pattern;
};

std::vector<std::string> components(const std::string& path) {
  std::vector<std::string> parts{""};
  for (const char letter : path) {
    if (letter == '/') parts.emplace_back();
    if (letter != '/') parts.back() += letter;
  }
  return parts;
}

bool covers(const std::vector<std::string>& pattern, std::size_t p,
            const std::vector<std::string>& path, std::size_t at) {
  if (p == pattern.size()) return at == path.size();
  if (pattern[p] == "**") {
    return covers(pattern, p + 1, path, at) ||
           (at < path.size() && covers(pattern, p, path, at + 1));
  }
  return at < path.size() && (pattern[p] == "*" || pattern[p] == path[at]) &&
         covers(pattern, p + 1, path, at + 1);
}

struct Model {
  std::vector<Line> lines;

  [[nodiscard]] bool knows(const std::string& identity) const {
    return std::ranges::any_of(lines, [&](const Line& line) { return line.identity == identity; });
  }
  [[nodiscard]] Role role(const std::string& identity, const std::string& path) const {
    // The server's own user may do everything unless a line names it.
    if (identity == own_user() && !knows(identity)) return Role::kAdminister;
    Role role = Role::kNone;
    for (const Line& line : lines) {
      if (line.identity != identity) continue;
      if (covers(components(line.pattern), 0, components(path), 0)) {
        role = std::max(role, kRoles[line.role]);
      }
    }
    return role;
  }
  [[nodiscard]] std::string text() const {
    std::string text;
    for (const Line& line : lines)
      text += line.identity + " role=" + kRoleNames[line.role] + " on=" + line.pattern + "\n";
    return text;
  }
};

// --- The callers' attempts ---

enum class Way : std::uint8_t { kCall, kReceipt, kOneway, kStream };
constexpr std::array kWays{Way::kCall, Way::kReceipt, Way::kOneway, Way::kStream};

/// The results of one object's bind, describe and calls.
struct Outcome {
  wire::Status bound{};
  wire::Status described{};
  /// The calls' statuses by method and way; a oneway has kOk.
  std::array<std::array<wire::Status, kWays.size()>, kMethods.size()> called{};
};
/// All results, as a caller in another process can report them.
struct Outcomes {
  bool is_open = false;
  bool is_alive = false;  ///< Whether the session answers a ping at the end.
  std::array<Outcome, 5> objects{};
  std::array<char, 512> similar{};  ///< The suggestions for a bind of an unknown path.
};

/// A caller that tries everything over one session, call by call.
class Prober {
 public:
  using Answer = std::pair<wire::Status, Bytes>;

  Prober() = default;
  Prober(const Prober&) = delete;
  Prober& operator=(const Prober&) = delete;
  virtual ~Prober() = default;

  [[nodiscard]] Outcomes probe() {
    Outcomes all;
    all.is_open = open(std::chrono::milliseconds{300});
    if (!all.is_open) return all;
    const Bytes similar = bind("lab/arm").second;
    std::ranges::transform(std::span(similar).first(std::min(similar.size(), all.similar.size())),
                           all.similar.begin(), [](std::byte b) { return static_cast<char>(b); });
    for (std::uint32_t i = 0; i < kPaths.size(); ++i) {
      Outcome& outcome = all.objects[i];
      outcome.bound = bind(kPaths[i]).first;
      Bytes number(wire::kDescribeRequestSize);
      wire::encode_describe_request(i + 1, number);
      outcome.described = ask(0, wire::kMethodDescribe, number, Way::kCall).first;
      for (std::size_t m = 0; m < kMethods.size(); ++m) {
        for (const Way way : kWays) {
          const bool is_tried = way != Way::kStream || kMethods[m].id == vault::kWatch.id;
          if (!is_tried) continue;
          outcome.called[m][static_cast<std::size_t>(way)] =
              ask(i + 1, kMethods[m].id, {}, way).first;
        }
      }
    }
    all.is_alive = ask(0, wire::kMethodPing, {}, Way::kCall).first == wire::Status::kOk;
    return all;
  }

 private:
  [[nodiscard]] virtual bool open(Duration patience) = 0;
  [[nodiscard]] virtual Answer ask(std::uint32_t service, std::uint16_t method, ConstBytes payload,
                                   Way way) = 0;
  Answer bind(std::string_view path) {
    Bytes request(512);
    request.resize(wire::encode(wire::BindRequest{path, vault::kInterface.name, 99}, request));
    return ask(0, wire::kMethodBind, request, Way::kCall);
  }
};

/// A caller in a session that is not sealed.
class PlainProber final : public Prober {
 public:
  PlainProber(Transport transport, std::uint16_t port) : peer_(transport, port) {}

 private:
  bool open(Duration patience) override { return peer_.open(patience); }
  Answer ask(std::uint32_t service, std::uint16_t method, ConstBytes payload, Way way) override {
    Bytes frame =
        peer_.call_frame(++call_id_, method,
                         {reinterpret_cast<const char*>(payload.data()), payload.size()}, service);
    auto header = *wire::decode_frame(frame);
    if (way == Way::kReceipt) header.flags = wire::kFlagReplyOnReceipt;
    if (way == Way::kOneway) header.flags = wire::kFlagNoReply;
    if (way == Way::kStream) header.item = 4;
    wire::encode(header, frame.data());
    peer_.send(frame);
    if (way == Way::kOneway) return {wire::Status::kOk, {}};
    while (const auto answer = peer_.receive(rt::now() + std::chrono::seconds{10})) {
      const auto about = wire::decode_frame(*answer);
      if (!about || about->call_id != call_id_ || about->kind == wire::FrameKind::kWelcome)
        continue;
      return {about->status, Bytes(answer->begin() + wire::kHeaderSize, answer->end())};
    }
    ADD_FAILURE() << "no answer to method " << method << " of " << service;
    return {wire::Status::kUnknownSession, {}};
  }

  RawPeer peer_;
  std::uint32_t call_id_ = 0;
};

/// A caller in a sealed session, with a key.
class KeyProber final : public Prober {
 public:
  KeyProber(Transport transport, const Server& server, const crypto::KeyPair& key)
      : peer_(transport, server.port(), *server.public_key(), key), items_(32 * 2048) {}

 private:
  bool open(Duration patience) override { return peer_.open(patience); }
  Answer ask(std::uint32_t service, std::uint16_t method, ConstBytes payload, Way way) override {
    wire::CallParameters parameters{.service = service, .method = method};
    if (way == Way::kReceipt) parameters.delivery = wire::Delivery::kReceipt;
    if (way == Way::kOneway) parameters.delivery = wire::Delivery::kSent;
    if (way == Way::kStream) {
      parameters.stream_window = 4;
      parameters.stream_buffers = {items_, 1328, {}, 8192};
    }
    EXPECT_TRUE(peer_.begin_any(parameters, payload));
    if (way == Way::kOneway) return {wire::Status::kOk, {}};
    const auto reply = peer_.await(rt::now() + std::chrono::seconds{10});
    EXPECT_EQ(reply.kind, wire::ChannelEvent::Kind::kReply);
    // The call's slot is free after the last item.
    while (way == Way::kStream && peer_.channel().next_item(peer_.channel().last_call())) {
    }
    return {reply.status, reply.payload};
  }

  rtpm::test::SealedPeer peer_;
  Bytes items_;
};

/// A caller of another user: a process that probes the given ports one after the other.
class OtherUser {
 public:
  OtherUser() {
    std::array<int, 2> to{};
    std::array<int, 2> from{};
    EXPECT_EQ(pipe(to.data()), 0);
    EXPECT_EQ(pipe(from.data()), 0);
    child_ = fork();
    if (child_ == 0) {
      close(to[1]);
      close(from[0]);
      std::uint16_t port = 0;
      if (setuid(kOtherUser) != 0) _exit(1);
      while (read(to[0], &port, sizeof port) == sizeof port) {
        const Outcomes outcomes =
            is_served(port) ? PlainProber(Transport::kSharedMemory, port).probe() : Outcomes{};
        if (write(from[1], &outcomes, sizeof outcomes) != sizeof outcomes) _exit(1);
      }
      _exit(0);
    }
    close(to[0]);
    close(from[1]);
    to_ = to[1];
    from_ = from[0];
  }
  OtherUser(const OtherUser&) = delete;
  OtherUser& operator=(const OtherUser&) = delete;
  ~OtherUser() {
    close(to_);
    close(from_);
    waitpid(child_, nullptr, 0);
  }
  [[nodiscard]] Outcomes probe(std::uint16_t port) const {
    Outcomes outcomes;
    EXPECT_EQ(write(to_, &port, sizeof port), static_cast<ssize_t>(sizeof port));
    EXPECT_EQ(read(from_, &outcomes, sizeof outcomes), static_cast<ssize_t>(sizeof outcomes));
    return outcomes;
  }

 private:
  static bool is_served(std::uint16_t port) {
    return transport::is_shared_memory_served({"127.0.0.1", port}, rt::now() + kPatience);
  }
  static constexpr Duration kPatience = std::chrono::seconds{10};

  pid_t child_ = -1;
  int to_ = -1;
  int from_ = -1;
};

// --- The comparison ---

/// The number of expected runs of each method of each object, according to the model.
using Runs = std::array<std::array<int, kMethods.size()>, 5>;

void compare(const Model& model, const std::string& identity, const Outcomes& outcomes,
             Runs& runs) {
  bool is_stranger = true;
  for (const std::string& path : kPaths)
    is_stranger = is_stranger && model.role(identity, path) == Role::kNone;
  if (!outcomes.is_open) {
    // A stranger need not even have a session.
    EXPECT_FALSE(model.knows(identity) || identity == own_user());
    return;
  }
  EXPECT_TRUE(outcomes.is_alive);
  const std::string similar(outcomes.similar.begin(), outcomes.similar.end());
  for (std::size_t i = 0; i < kPaths.size(); ++i) {
    const Role role = model.role(identity, kPaths[i]);
    SCOPED_TRACE(kPaths[i]);
    if (role == Role::kNone) {
      EXPECT_EQ(similar.find(kPaths[i] + '\0'), std::string::npos);
    }
    const Outcome& outcome = outcomes.objects[i];
    const auto shown = role == Role::kNone ? wire::Status::kNoSuchObject : wire::Status::kOk;
    EXPECT_EQ(outcome.bound, shown);
    EXPECT_EQ(outcome.described, shown);
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
      SCOPED_TRACE(kMethods[m].name);
      const bool may_run = role >= kMethods[m].role;
      const auto status = may_run ? wire::Status::kOk : wire::Status::kNotAllowed;
      EXPECT_EQ(outcome.called[m][0], status);
      EXPECT_EQ(outcome.called[m][1], status);
      const bool has_stream = kMethods[m].id == vault::kWatch.id;
      if (has_stream) {
        EXPECT_EQ(outcome.called[m][3], status);
      }
      if (may_run) runs[i][m] += has_stream ? 4 : 3;
    }
  }
  if (is_stranger) {
    EXPECT_EQ(similar, std::string(similar.size(), '\0'));
  }
}

// A caller of the same program binds over a transport, and calls without one.
void compare_local(const Model& model, Server& server, Runs& runs) {
  Node node(quiet_node(Transport::kLocal));
  for (std::size_t i = 0; i < kPaths.size(); ++i) {
    SCOPED_TRACE(kPaths[i]);
    const Role role = model.role(own_user(), kPaths[i]);
    auto binding = Binding::bind(node, server.url(kPaths[i]), vault::kInterface);
    ASSERT_EQ(binding.has_value(), role != Role::kNone);
    if (!binding) continue;
    ASSERT_EQ(binding->transport(), Transport::kLocal);
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
      SCOPED_TRACE(kMethods[m].name);
      const bool may_run = role >= kMethods[m].role;
      const auto reply = binding->call(kMethods[m], {});
      EXPECT_EQ(reply.has_value(), may_run);
      if (!reply) {
        EXPECT_EQ(reply.error(), CallError::kNotAllowed);
      }
      EXPECT_TRUE(binding->send(kMethods[m], {}, wire::Delivery::kSent));
      if (may_run) runs[i][m] += 2;
    }
  }
}

/// The keys of two callers, and of a stranger that no line names.
using Keys = std::array<crypto::KeyPair, 3>;

std::string text_of(const crypto::KeyPair& key) {
  access::Subject subject;
  subject.kind = access::Subject::Kind::kKey;
  subject.key = key.public_key;
  return access::to_text(subject);
}

struct Round {
  Model model;
  ServerConfig config = quiet_config();
  bool has_strangers = false;
};

// Tries each identity with each role on each pattern; then with all lines at once, and with none.
std::vector<Round> rounds(const Keys& keys) {
  const std::string other = "uid:" + std::to_string(kOtherUser);
  const std::vector<std::string> identities{own_user(), other, "anonymous", text_of(keys[0]),
                                            text_of(keys[1])};
  std::vector<Round> rounds;
  const std::size_t count = kRoles.size() * kPatterns.size();
  for (std::size_t i = 0; i < count; ++i) {
    Round round;
    for (std::size_t who = 0; who < identities.size(); ++who) {
      // Each identity gets a different cell, so that a mix-up of rights shows.
      const std::size_t cell = (i + who * 11) % count;
      round.model.lines.push_back(
          {identities[who], cell % kRoles.size(), kPatterns[cell / kRoles.size()]});
    }
    // Every third round uses a lane of several threads.
    if (i % 3 == 2) round.config.lanes[0].buffered_request_max = 16;
    rounds.push_back(std::move(round));
  }
  rounds.push_back({.model = {{{"uid:4242", 0, "**"}}}, .has_strangers = true});
  rounds.push_back({.model = {{{other, 0, "lab/**"},
                               {other, 2, "lab/arm1"},
                               {"anonymous", 0, "public/**"},
                               {"anonymous", 1, "*"},
                               {text_of(keys[0]), 3, "lab/arm1"},
                               {text_of(keys[0]), 0, "**"}}},
                    .has_strangers = true});
  return rounds;
}

// The system may not tell a peer's address, or a local user.
TEST(AccessMatrix, FindsAnUnknownPeerInNoRange) {
  const std::string line = "anonymous role=observe on=** from=";
  for (const std::string range : {"::/0", "0.0.0.0/0", "::", "0.0.0.0"}) {
    const access::Grants grants(access::parse_authorized(line + range + "\n").grants);
    for (const CallOrigin& unknown : {origin_of_user(std::nullopt), origin_at(nullptr, {})})
      EXPECT_FALSE(grants.knows(unknown.subject, unknown.address)) << range;
  }
  const access::Grants grants(access::parse_authorized(line + "::/0\n").grants);
  const CallOrigin known = origin_at(nullptr, transport::this_host());
  EXPECT_TRUE(grants.knows(known.subject, known.address));
}

// hp-6.4-1, hp-6.4-2, hp-16.1-4
TEST(AccessMatrix, MatchesTheLinesOverEveryTransport) {
  std::optional<OtherUser> other;
  if (geteuid() == 0 && transport::offers_shared_memory()) other.emplace();
  const KeyFolder folder;
  const Keys keys{crypto::KeyPair::generate(), crypto::KeyPair::generate(),
                  crypto::KeyPair::generate()};
  for (const Round& round : rounds(keys)) {
    const Model& model = round.model;
    SCOPED_TRACE(model.text());
    const SecuredServer secured(folder, model.text(), kPaths, round.config);
    ASSERT_TRUE(secured.server);
    const std::uint16_t port = secured.server->port();
    Runs runs{};
    const auto check = [&](const char* how, const std::string& identity, const Outcomes& outcomes) {
      SCOPED_TRACE(identity + " over " + how);
      compare(model, identity, outcomes, runs);
    };
    if (transport::offers_shared_memory())
      check("shared memory", own_user(), PlainProber(Transport::kSharedMemory, port).probe());
    check("UDP", "anonymous", PlainProber(Transport::kUdp, port).probe());
    check("TCP", "anonymous", PlainProber(Transport::kTcp, port).probe());
    if (other) {
      check("shared memory", "uid:" + std::to_string(kOtherUser), other->probe(port));
    }
    for (const crypto::KeyPair& key : keys) {
      // A stranger gets only hints, and waits in vain for answers, so it skips most rounds.
      if (!model.knows(text_of(key)) && !round.has_strangers) continue;
      check("sealed UDP", text_of(key), KeyProber(Transport::kUdp, *secured.server, key).probe());
      check("sealed TCP", text_of(key), KeyProber(Transport::kTcp, *secured.server, key).probe());
    }
    compare_local(model, *secured.server, runs);
    const auto has_run = [&](std::size_t i, std::size_t m) {
      return secured.vaults[i]->run_counts[m] >= runs[i][m];
    };
    for (std::size_t i = 0; i < kPaths.size(); ++i) {
      for (std::size_t m = 0; m < kMethods.size(); ++m) {
        EXPECT_TRUE(test::await([&] { return has_run(i, m); }));
        EXPECT_EQ(secured.vaults[i]->run_counts[m], runs[i][m])
            << kPaths[i] << " " << kMethods[m].name;
      }
      EXPECT_EQ(secured.vaults[i]->nobody_count, 0);
    }
    if (testing::Test::HasFailure()) return;
  }
  if (!other) GTEST_SKIP() << "without another user: that takes root";
}

}  // namespace
}  // namespace rtpm::rpc
