#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/outcome.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// A bound name as the registry tells it.
struct NameEntry {
  std::string name;
  std::string url;
  std::string interface;
  Duration lease_left{};       ///< When the registry answered.
  std::uint64_t revision = 0;  ///< Of its holder: what a rebind names that is to replace it.
};

/// Why an operation on the registry failed.
struct DirectoryError {
  /// What the registry answered; none: it did not answer, and whether it acted is unknown.
  std::optional<Outcome> outcome{};
  /// One sentence that names the thing, the cause and the remedy.
  std::string text;
  /// Who holds the name, for kAlreadyBound, kStaleEpoch and kStaleRevision.
  std::string holder_url{};
  Duration holder_lease_left{};
  std::uint64_t holder_revision = 0;
};

/// A client of the registry: every operation asks it once. A registry that restarted is found again
/// by the next operation.
/// @ownership refers to its node, which must outlive it
/// @threads  any, several at once. Set-up only: no operation is for real-time threads. Errors of
///           all operations: the registry's URL is none; "no registry answers at …" within
///           `deadline`; what the registry refused
class Directory {
 public:
  /// `deadline` is for each operation, of which a list may take several.
  explicit Directory(rpc::Node& node, std::string registry_url = std::string(kDefaultRegistryUrl),
                     Duration deadline = std::chrono::seconds{1});
  Directory(Directory&&) noexcept;
  Directory& operator=(Directory&&) noexcept;
  ~Directory();

  /// As Store::bind(); the registry itself sees from which host.
  [[nodiscard]] expected<Granted, DirectoryError> bind(const Claim& claim);
  /// As Store::rebind(), likewise.
  [[nodiscard]] expected<Granted, DirectoryError> rebind(const Claim& claim);
  /// As Store::renew().
  [[nodiscard]] expected<void, DirectoryError> renew(std::string_view name, Owner owner,
                                                     Duration lease);
  /// As Store::resolve(). Ends by `deadline`, too.
  [[nodiscard]] expected<NameEntry, DirectoryError> resolve(std::string_view name,
                                                            MonotonicTime deadline = kNever);
  /// As Store::unbind().
  [[nodiscard]] expected<void, DirectoryError> unbind(std::string_view name, Owner owner);
  /// Every name that is `directory` or below it; empty: all.
  [[nodiscard]] expected<std::vector<NameEntry>, DirectoryError> list(
      std::string_view directory = {});

  [[nodiscard]] const std::string& registry_url() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// The owner for names whose objects a server serves at `url`, in this start of this program.
/// Servers that follow each other at one address of one host are the same owner; since an address
/// has one server at a time, no two that live are.
/// @realtime set-up only
[[nodiscard]] Owner owner_of(std::string_view url);

}  // namespace rtpm::names
