#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// A client of one name service, or of registries that share their names: Directory's operations
/// and errors at one URL, or at several separated by ','.
/// @threads  any, several at once
class Service {
 public:
  /// `deadline` bounds each request.
  Service(rpc::Node& node, std::string url, Duration deadline);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service();

  [[nodiscard]] expected<Granted, DirectoryError> bind(const Claim& claim, bool replaces);
  /// Ends at the latest by `deadline` from now.
  [[nodiscard]] expected<void, DirectoryError> renew(std::string_view name, Owner owner,
                                                     Duration lease,
                                                     Duration deadline = Duration::max());
  [[nodiscard]] expected<void, DirectoryError> unbind(std::string_view name, Owner owner,
                                                      std::uint64_t holder_revision);
  [[nodiscard]] expected<NameEntry, DirectoryError> look_up(std::string_view name,
                                                            bool has_properties,
                                                            MonotonicTime deadline);
  [[nodiscard]] expected<FoundNames, DirectoryError> find(const NameQuery& query);
  /// See Directory::contents().
  [[nodiscard]] expected<FoundNames, DirectoryError> contents(std::string_view directory);
  /// Reads the contents within `deadline` in total, into `found`, which keeps what came before an
  /// error.
  [[nodiscard]] expected<void, DirectoryError> read(std::string_view directory,
                                                    MonotonicTime deadline, FoundNames& found);
  /// Adds the lapsed names to `found`, within `deadline` in total.
  /// @errors   the service keeps no lapsed names
  [[nodiscard]] expected<void, DirectoryError> read_lapsed(MonotonicTime deadline,
                                                           std::vector<LapsedName>& found);

  [[nodiscard]] const std::string& url() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::names
