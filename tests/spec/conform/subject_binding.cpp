#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include "rtpm/rpc/binding.hpp"
#include "subject.hpp"

namespace rtpm::spec {
namespace {

/// RTPM's client as applications use it: a binding manages sessions by itself. It does one thing at
/// a time, and reads no line meanwhile.
class BindingSide final : public Side {
 public:
  explicit BindingSide(const Line& setup)
      : url_("rtpm://" + setup.value("address") + "/"), node_(config_of(setup)) {
    say("ready");
  }

  [[nodiscard]] std::vector<int> sockets() const override { return {}; }
  void on_readable(int) override {}
  void on_time() override {}
  [[nodiscard]] MonotonicTime next_time() const override { return kNever; }

  void on_line(const Line& line) override {
    if (line.word(0) == "counters") {
      say("counters unknown");
    } else if (line.word(1) == "bind_object") {
      bind(line);
    } else if (line.word(1) == "call_object" && binding_) {
      call(line);
    } else {
      say("cannot " + line.word(1));
    }
  }

 private:
  static rpc::NodeConfig config_of(const Line& setup) {
    rpc::NodeConfig config;
    config.message_size_max = static_cast<std::uint32_t>(setup.number("message_size_max"));
    return config;
  }
  static Duration timeout_of(const Line& line) {
    return std::chrono::microseconds(line.number("timeout_us"));
  }

  void bind(const Line& line) {
    std::istringstream parts(line.value("methods"));
    for (std::string part; std::getline(parts, part, ',');) {
      const std::size_t colon = part.find(':');
      methods_.push_back(
          {.id = static_cast<std::uint16_t>(std::stoul(part.substr(0, colon))),
           .fingerprint = static_cast<std::uint32_t>(std::stoul(part.substr(colon + 1)))});
    }
    name_ = line.value("interface");
    interface_.name = name_;
    interface_.fingerprint = line.number("fingerprint");
    interface_.methods = methods_;
    const Priority priority = static_cast<int>(line.number("priority"));
    auto bound = rpc::Binding::bind(
        node_, url_ + line.value("path"), interface_,
        {.transport = rpc::Transport::kUdp, .deadline = timeout_of(line), .warm_up = {priority}});
    if (bound) binding_.emplace(std::move(*bound));
    say(binding_ ? "sees bound" : "sees not_bound");
  }

  void call(const Line& line) {
    const rpc::MethodDescriptor method{.id = static_cast<std::uint16_t>(line.number("method")),
                                       .is_idempotent = line.number("is_idempotent") != 0};
    const auto reply = binding_->call(method, bytes_of(line.value("payload")),
                                      {.priority = static_cast<int>(line.number("priority")),
                                       .deadline = timeout_of(line),
                                       .trace_id = line.number("trace_id")});
    if (reply) return say("sees result status=ok payload=" + hex_of_bytes(reply->bytes()));
    if (reply.error() == rpc::CallError::kPeerRestarted) return say("sees may_have_run");
    say("sees result status=" + std::string(to_string(reply.error())));
  }

  std::string url_;
  rpc::Node node_;
  std::vector<rpc::MethodDescriptor> methods_;
  std::string name_;
  rpc::InterfaceDescriptor interface_;
  std::optional<rpc::Binding> binding_;
};

}  // namespace

std::unique_ptr<Side> make_binding(const Line& setup) {
  return std::make_unique<BindingSide>(setup);
}

}  // namespace rtpm::spec
