#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::etcd_store {

/// The endpoints of a cluster, and the prefix of names in it.
struct Address {
  std::vector<std::string> endpoints{};  ///< "host:port".
  std::string prefix{};                  ///< The prefix of all keys, without a trailing '/'.

  [[nodiscard]] std::string text() const;  ///< "etcd://host:port,host:port/prefix"
};

/// @errors   the text does not have the form in make_etcd_storage()
[[nodiscard]] expected<Address, SetupError> parse_address(std::string_view url);

}  // namespace rtpm::etcd_store
