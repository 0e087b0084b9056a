// A valve that is served and called, in one program.
#include <cstdio>
#include <string>
#include <valve.rtpm.hpp>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace {

class Valve final : public plant::ValveServant {
 public:
  rtpm::rpc::Result<void> set(const plant::Opening& opening,
                              const rtpm::rpc::CallContext&) override {
    opening_ = opening;
    return {};
  }
  rtpm::rpc::Result<plant::Opening> get(const rtpm::rpc::CallContext&) override { return opening_; }

 private:
  plant::Opening opening_{};
};

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

}  // namespace

int main() {
  auto server = rtpm::rpc::Server::create({.realtime = rtpm::rt::RealtimeMode::kOff});
  if (!server) return fail(server.error().text());
  Valve valve;
  if (auto added = (*server)->add("plant/valve", valve); !added) return fail(added.error().text());
  if (auto started = (*server)->start(); !started) return fail(started.error().text());

  rtpm::rpc::Node node;
  auto remote = plant::ValveClient::bind(node, (*server)->url("plant/valve"));
  if (!remote) return fail(remote.error().text());
  if (auto set = remote->set(plant::Opening(0.25)); !set) {
    return fail(std::string(to_string(set.error())));
  }
  const auto opening = remote->get();
  if (!opening) return fail(std::string(to_string(opening.error())));
  std::printf("the valve is open by %.2f\n", opening->share());
  return 0;
}
