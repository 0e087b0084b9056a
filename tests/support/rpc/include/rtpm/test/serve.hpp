#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "rtpm/rpc/server.hpp"
#include "rtpm/test/made.hpp"

namespace rtpm::test {

/// Starts a server of `servant`, without real-time threads. Fails the test if that is impossible,
/// and returns null if there is no server at all.
[[nodiscard]] inline std::unique_ptr<rpc::Server> serve(
    std::string_view path, rpc::Servant& servant, rpc::ServerConfig config = {},
    const std::optional<rpc::ObjectOptions>& options = std::nullopt) {
  config.realtime = rt::RealtimeMode::kOff;
  auto server = made(rpc::Server::create(std::move(config)));
  if (server == nullptr) return server;
  const auto added = options ? server->add(path, servant, *options) : server->add(path, servant);
  EXPECT_TRUE(added) << added.error().text();
  const auto started = server->start();
  EXPECT_TRUE(started) << started.error().text();
  return server;
}

}  // namespace rtpm::test
