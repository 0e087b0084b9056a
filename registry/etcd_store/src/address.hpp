#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::etcd_store {

/// Where a cluster is, and where in it names are.
struct Address {
  std::vector<std::string> endpoints{};  ///< "host:port".
  std::string prefix{};                  ///< Of all keys, without a '/' at its end.

  [[nodiscard]] std::string text() const;  ///< "etcd://host:port,host:port/prefix"
};

/// @errors   it is not as make_etcd_storage() says
[[nodiscard]] expected<Address, SetupError> parse_address(std::string_view url);

}  // namespace rtpm::etcd_store
