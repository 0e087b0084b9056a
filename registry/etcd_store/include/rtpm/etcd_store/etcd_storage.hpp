#pragma once

#include <memory>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/storage.hpp"

namespace rtpm::etcd_store {

/// Whether `place` begins with "etcd://".
[[nodiscard]] bool is_etcd_url(std::string_view place) noexcept;

/// Names that any number of registries share, in etcd 3.4 or later: one key per name, etcd's
/// revisions and leases, and one watch. A change is conditional on the state that it replaces, and
/// is sent to the next endpoint until one answers or its deadline is over. It does not read the
/// wall clock.
/// @param url  "etcd://host:port,host:port/prefix": 1 to 16 endpoints of one cluster; without a
///             prefix "rtpm"
/// @realtime set-up only
/// @errors   the URL is malformed; it connects only in load()
[[nodiscard]] expected<std::unique_ptr<names::Storage>, SetupError> make_etcd_storage(
    std::string_view url);

}  // namespace rtpm::etcd_store
