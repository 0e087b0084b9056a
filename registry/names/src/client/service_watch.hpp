#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/names/watch.hpp"

namespace rtpm::names {

/// A watch at one service, or at the services of a scope.
class NameWatch::Impl {
 public:
  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  virtual ~Impl() = default;
  [[nodiscard]] virtual expected<void, DirectoryError> begin() = 0;
  virtual void set_names(std::vector<std::string> names) = 0;
  [[nodiscard]] virtual std::uint64_t revision() const noexcept = 0;
  [[nodiscard]] virtual std::uint64_t state_count() const noexcept = 0;
  [[nodiscard]] virtual bool is_connected() const noexcept = 0;
};

/// A watch at one service, or at registries that share their names; `url` as for Service.
[[nodiscard]] std::unique_ptr<NameWatch::Impl> make_service_watch(rpc::Node& node, std::string url,
                                                                  WatchConfig config,
                                                                  WatchHandlers handlers);

}  // namespace rtpm::names
