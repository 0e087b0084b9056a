#pragma once

#include <string>

#include "interop.rtpm.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::interop {

struct CheckConfig {
  std::string url{};
  rpc::Transport transport = rpc::Transport::kUdp;
  std::string registry{};  ///< The rest may be empty.
  std::string name{};
  std::string device{};
  bool is_lossy = false;
};

/// Checks the server and prints a line of JSON per case, see tests/interop/README.md. Returns
/// whether no case failed.
[[nodiscard]] bool check(rpc::Node& node, const CheckConfig& config);

}  // namespace rtpm::interop
