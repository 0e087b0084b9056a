// An arm that is served and called, as a whole program.
#include <chrono>
#include <cstdio>
#include <lab.rtpm.hpp>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace {

using namespace std::chrono_literals;

/// Goes one millimetre in the direction of each force.
class MyArm final : public lab::ArmServant {
 public:
  rtpm::rpc::Result<lab::Position> get_position(const rtpm::rpc::CallContext&) override {
    return position_;
  }
  rtpm::rpc::Result<void> set_force(const lab::Force& force,
                                    const rtpm::rpc::CallContext&) override {
    position_ = lab::Position(position_.x() + 0.001 * force.x(), position_.y() + 0.001 * force.y(),
                              position_.z() + 0.001 * force.z());
    return {};
  }

 private:
  lab::Position position_{};
};

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

}  // namespace

int main() {
  auto server = rtpm::rpc::Server::create(
      {.lanes = {{.low = 0}, {.low = 16000}}, .realtime = rtpm::rt::RealtimeMode::kOff});
  if (!server) return fail(server.error().text());
  MyArm my_arm;
  if (auto added = (*server)->add("lab/arm0", my_arm); !added) return fail(added.error().text());
  if (auto started = (*server)->start(); !started) return fail(started.error().text());

  rtpm::rpc::Node node;
  auto arm = lab::ArmClient::bind(node, (*server)->url("lab/arm0"));
  if (!arm) return fail(arm.error().text());
  const auto set = arm->set_force({1, 2, 3});
  if (!set) return fail(std::string(to_string(set.error())));
  const auto position = arm->get_position({}, {.priority = 24000, .deadline = 800ms});
  if (!position) return fail(std::string(to_string(position.error())));
  std::printf("the arm is at %.3f %.3f %.3f m\n", position->x(), position->y(), position->z());
  return 0;
}
