#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Whether names may move to the name service found at `url`, and be taken from it if another
/// service has them, too: a service at a loopback address may belong to another user.
/// @realtime set-up only
/// @errors   those of rpc::check_local_server()
[[nodiscard]] expected<void, SetupError> check_service(rpc::Node& node, const std::string& url);

}  // namespace rtpm::names
