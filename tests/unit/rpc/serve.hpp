#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string_view>
#include <utility>

#include "rtpm/test/echo_server.hpp"

namespace rtpm::rpc::test {

/// A started server of `config` with one object; fails the test if it does not start.
[[nodiscard]] inline std::unique_ptr<Server> serve(Servant& servant, std::string_view path = "echo",
                                                   ServerConfig config = quiet_config(),
                                                   ObjectOptions options = {}) {
  auto server = Server::create(std::move(config));
  EXPECT_TRUE(server) << server.error().text();
  EXPECT_TRUE((*server)->add(path, servant, std::move(options)));
  EXPECT_TRUE((*server)->start());
  return std::move(*server);
}

}  // namespace rtpm::rpc::test
