#pragma once

#include <memory>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::etcd_store {

/// Whether `place` begins with "etcd://".
[[nodiscard]] bool is_etcd_url(std::string_view place) noexcept;

/// Names that any number of registries have together, in etcd 3.4 or later: a key for each name,
/// etcd's revisions and leases, and one watch. A change is conditional on what it replaces, and is
/// sent to the next endpoint until one answers or its deadline is over. No wall clock is read.
/// @param url  "etcd://host:port,host:port/prefix": 1 to 16 endpoints of one cluster; without a
///             prefix "rtpm"
/// @realtime set-up only
/// @errors   the URL is malformed; nothing is reached before load()
[[nodiscard]] expected<std::unique_ptr<names::SharedStorage>, SetupError> make_etcd_storage(
    std::string_view url);

}  // namespace rtpm::etcd_store
