#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "rtpm/names/directory.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Resolves a node's names at the registry: `node.use(resolver)`. It watches the names that it has
/// resolved (NameWatch), so that bindings follow a moved or restarted server as soon as the
/// registry knows. If the registry accepts no more watches, a binding looks its name up when a call
/// fails.
/// @ownership refers to its node, which must outlive it; detaches on destruction, and bindings stay
///            with their servers
/// @threads  any, concurrently
/// @realtime set-up only
class RegistryResolver final : public rpc::Resolver {
 public:
  explicit RegistryResolver(rpc::Node& node, std::string where = std::string(kThisHost));

  RegistryResolver(const RegistryResolver&) = delete;
  RegistryResolver& operator=(const RegistryResolver&) = delete;
  ~RegistryResolver() override;

  /// Asks the registry for the URL of a name.
  /// @errors   "no registry answers at …"; the name is not bound (the text names the missing
  ///           component)
  [[nodiscard]] expected<std::string, SetupError> resolve(std::string_view name,
                                                          MonotonicTime deadline) override;

  /// How often watched names started to lead elsewhere.
  [[nodiscard]] std::uint64_t move_count() const;

 private:
  /// The URL that a name led to when it was last resolved or reported.
  struct Lead {
    std::string url{};
    std::uint64_t revision = 0;
    friend bool operator==(const Lead&, const Lead&) = default;
  };

  void watch(std::string_view name, const NameEntry& entry, MonotonicTime deadline);
  void note(const NameChange& change);

  rpc::Node& node_;
  Directory directory_;
  mutable std::mutex mutex_;  ///< Guards the members below; not for real-time threads.
  std::map<std::string, Lead, std::less<>> leads_{};  ///< Keyed by names that may be bound.
  std::uint64_t move_count_ = 0;
  std::mutex starting_;  ///< Held while the watch starts.
  std::unique_ptr<NameWatch> watch_{};
};

}  // namespace rtpm::names
