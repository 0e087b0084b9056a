// An arm in an Asio loop, beside a timer: registry/asio/README.md explains it.
#include <asio/co_spawn.hpp>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <lab.rtpm.hpp>
#include <string>

#include "rtpm/asio/calls.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

using namespace std::chrono_literals;

/// Goes one millimetre in the direction of each force.
class Arm final : public lab::ArmServant {
  rtpm::rpc::Result<lab::Position> get_position(const rtpm::rpc::CallContext&) override {
    return position_;
  }
  rtpm::rpc::Result<void> set_force(const lab::Force& force,
                                    const rtpm::rpc::CallContext&) override {
    position_ = lab::Position(position_.x() + 0.001 * force.x(), 0, 0);
    return {};
  }
  lab::Position position_{};
};

/// The client: pulls a hundred times a second. A failed call throws a system_error.
static asio::awaitable<void> pull(rtpm::asio::Calls& calls, rtpm::rpc::Node& node,
                                  std::string url) {
  auto arm = co_await calls.async_set_up([&] { return lab::ArmClient::bind(node, url); },
                                         asio::use_awaitable);
  if (!arm) co_return static_cast<void>(std::printf("%s\n", arm.error().text().c_str()));
  asio::steady_timer timer(calls.get_executor());
  for (int i = 0; i < 5; ++i) {
    co_await calls.async_call(arm->begin_set_force({1, 0, 0}, {.deadline = 5s}),
                              asio::use_awaitable);
    const lab::Position at =
        co_await calls.async_call(arm->begin_get_position(), asio::use_awaitable);
    std::printf("the arm is at %.3f m\n", at.x());
    timer.expires_after(10ms);
    co_await timer.async_wait(asio::use_awaitable);
  }
}

int main() {
  Arm arm;
  const auto server = rtpm::rpc::Server::create({.realtime = rtpm::rt::RealtimeMode::kOff}).value();
  server->add("lab/arm0", arm).value();
  server->start().value();
  rtpm::rpc::Node node;
  asio::io_context loop;
  rtpm::asio::Calls calls(loop);
  asio::co_spawn(loop, pull(calls, node, server->url("lab/arm0")), [](std::exception_ptr error) {
    if (error) std::rethrow_exception(error);
  });
  loop.run();
}
