#pragma once

#include <memory>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::etcd_store {

/// Names shared by any number of registries, in etcd 3.4 or later: one key per name, with etcd's
/// revisions and leases, and one watch. A change is conditional on the state that it replaces. It
/// is sent to one endpoint after another until one answers or its deadline passes. Does not use the
/// wall clock.
/// @param url  "etcd://host:port,host:port/prefix": 1 to 16 endpoints of one cluster; the default
///           prefix is "rtpm"
/// @realtime set-up only
/// @errors   the URL is malformed; connects only in load()
[[nodiscard]] expected<std::unique_ptr<names::Storage>, SetupError> make_etcd_storage(
    std::string_view url);

}  // namespace rtpm::etcd_store
