#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <future>
#include <optional>
#include <utility>

#include "free_bytes.hpp"
#include "rtpm/rpc/binding.hpp"

// spec/vectors/conversations/ of level `bindings`: our bindings, over a UDP socket, follow the
// vectors.
namespace rtpm::spec {
namespace {

constexpr std::chrono::seconds kPatience{20};
/// The parts of a frame that differ from run to run: the low byte of flags (*repeated*), budget_us,
/// sender_time_ns, and in HELLO the client's identity and limits.
constexpr std::size_t kAtFlags = 6;
struct Range {
  std::size_t begin, end;
};
constexpr std::array<Range, 2> kFree{{{40, 44}, {48, 56}}};
constexpr Range kFreeInHello{wire::kHeaderSize + 8, wire::kHeaderSize + 36};

/// A frame, or the pattern of one, without the parts that differ from run to run.
std::string masked(const std::string& pattern, const Json& free) {
  constexpr std::size_t kAtKind = 3;
  const bool is_hello = pattern.substr(2 * kAtKind, 2) == "01";
  std::string text;
  std::size_t at = 0;
  for (std::size_t i = 0; i < pattern.size();) {
    if (pattern[i] == '<') {
      const std::size_t end = pattern.find('>', i);
      at += free.at(pattern.substr(i + 1, end - i - 1)).at("size").get<std::size_t>();
      text += pattern.substr(i, end + 1 - i);
      i = end + 1;
      continue;
    }
    const auto is_in = [&](Range range) { return range.begin <= at && at < range.end; };
    std::string byte = pattern.substr(i, 2);
    if (std::ranges::any_of(kFree, is_in) || (is_hello && is_in(kFreeInHello))) byte = "00";
    if (at == kAtFlags) byte = hex_of(Bytes{bytes_of_hex(byte).front() & std::byte{0xfe}});
    text += byte;
    ++at;
    i += 2;
  }
  return text;
}

/// The server's socket: it answers the latest sender.
class Port {
 public:
  Port() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&own), sizeof own), 0);
  }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;
  ~Port() { close(socket_); }

  [[nodiscard]] std::uint16_t number() const {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size), 0);
    return ntohs(own.sin_port);
  }
  /// The next frame; nullopt if none comes.
  [[nodiscard]] std::optional<std::string> receive() {
    pollfd readable{socket_, POLLIN, 0};
    if (poll(&readable, 1, std::chrono::milliseconds(kPatience).count()) <= 0) return std::nullopt;
    std::array<std::byte, 2048> buffer{};
    socklen_t size = sizeof peer_;
    const ssize_t count = recvfrom(socket_, buffer.data(), buffer.size(), 0,
                                   reinterpret_cast<sockaddr*>(&peer_), &size);
    return count < 0 ? std::nullopt
                     : std::optional(hex_of(ConstBytes(buffer).first(std::size_t(count))));
  }
  void send(const Bytes& frame) {
    EXPECT_EQ(sendto(socket_, frame.data(), frame.size(), 0, reinterpret_cast<sockaddr*>(&peer_),
                     sizeof peer_),
              static_cast<ssize_t>(frame.size()));
  }

 private:
  int socket_;
  sockaddr_in peer_{};
};

/// An application that binds one object and calls it, on another thread than the server's.
class Application {
 public:
  explicit Application(std::uint16_t port) : port_(port) {}

  void act(const Json& step) {
    ASSERT_FALSE(doing_.valid()) << "what was done before has no end in the vector";
    const std::string what = step.at("client_does");
    EXPECT_TRUE(what == "bind" || what == "call_object") << what;
    doing_ = std::async(std::launch::async,
                        [this, step, what] { return what == "bind" ? bind(step) : call(step); });
  }
  /// The application's result at the end of its action.
  [[nodiscard]] Json end() {
    if (!doing_.valid() || doing_.wait_for(kPatience) != std::future_status::ready) {
      return {{"client_sees", "nothing"}};
    }
    return doing_.get();
  }

 private:
  Json bind(const Json& step) {
    for (const Json& method : step.at("methods"))
      methods_.push_back({.id = method.at("id"), .fingerprint = method.at("fingerprint")});
    interface_name_ = step.at("interface");
    interface_.name = interface_name_;
    interface_.fingerprint = wide_number(step.at("fingerprint"));
    interface_.methods = methods_;
    const std::string url =
        "rtpm://127.0.0.1:" + std::to_string(port_) + "/" + step.at("path").get<std::string>();
    const Priority priority = step.at("priority").get<int>();
    auto bound = rpc::Binding::bind(
        node_, url, interface_,
        {.transport = rpc::Transport::kUdp, .deadline = kPatience, .warm_up = {priority}});
    if (bound) binding_.emplace(std::move(*bound));
    return {{"client_sees", bound ? "bound" : "not_bound"}};
  }
  Json call(const Json& step) {
    const rpc::MethodDescriptor method{.id = step.at("method"),
                                       .is_idempotent = step.at("is_idempotent")};
    const Priority priority = step.at("priority").get<int>();
    const auto reply = binding_->call(method, bytes_of_hex(step.at("payload")),
                                      {.priority = priority,
                                       .deadline = kPatience,
                                       .trace_id = wide_number(step.at("trace_id"))});
    if (reply) {
      return {{"client_sees", "result"}, {"status", "ok"}, {"payload", hex_of(reply->bytes())}};
    }
    const bool is_restarted = reply.error() == rpc::CallError::kPeerRestarted;
    return {{"client_sees", is_restarted ? "may_have_run" : to_string(reply.error())}};
  }

  std::uint16_t port_;
  rpc::Node node_{{.message_size_max = 1344}};
  std::vector<rpc::MethodDescriptor> methods_;
  std::string interface_name_;
  rpc::InterfaceDescriptor interface_;
  std::optional<rpc::Binding> binding_;
  std::future<Json> doing_;
};

/// Plays the server's part of a conversation, as in the vector.
class BindingPlayer {
 public:
  explicit BindingPlayer(const Json& conversation)
      : free_(conversation.at("free")), bytes_(free_, Role::kClient) {}

  /// Returns the mistake, "" if there is none.
  std::string take(const Json& step) {
    if (step.contains("client_does")) {
      application_.act(step);
    } else if (step.contains("client_sees")) {
      Json wanted = step;
      wanted.erase("at_ns");
      const Json seen = application_.end();
      if (seen != wanted) return "wanted: " + wanted.dump() + "\nseen: " + seen.dump();
    } else if (step.at("frame") == "server to client") {
      port_.send(bytes_of_hex(bytes_.fill_in(step.at("hex"))));
    } else {
      return receive(step.at("hex"));
    }
    return {};
  }

 private:
  std::string receive(const std::string& pattern) {
    const std::string wanted = masked(pattern, free_);
    while (const auto frame = port_.receive()) {
      const std::string there = masked(*frame, free_);
      if (bytes_.matches(wanted, there)) {
        taken_.push_back(there);
        return {};
      }
      // The client may repeat frames, since it cannot know which were lost.
      if (std::ranges::find(taken_, there) == taken_.end()) {
        return "wanted: " + wanted + "\nsent:   " + there;
      }
    }
    return "wanted: " + wanted + "\nnothing came";
  }

  Json free_;
  FreeBytes bytes_;
  Port port_;
  Application application_{port_.number()};
  std::vector<std::string> taken_;
};

std::vector<std::string> names() {
  std::vector<std::string> names = conversation_names();
  std::erase_if(names, [](const std::string& name) {
    return read_vectors("conversations/" + name + ".json").value("level", "") != "bindings";
  });
  return names;
}

class BindingConversations : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Vectors, BindingConversations, testing::ValuesIn(names()),
                         [](const auto& row) {
                           std::string name = row.param;
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

TEST_P(BindingConversations, GoAsTheySay) {
  const Json conversation = read_vectors("conversations/" + GetParam() + ".json");
  BindingPlayer player(conversation);
  std::size_t index = 0;
  for (const Json& step : conversation.at("steps")) {
    ASSERT_EQ(player.take(step), "") << "step " << index << ": " << step;
    ++index;
  }
}

}  // namespace
}  // namespace rtpm::spec
