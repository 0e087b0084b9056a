#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

class NamesClient;
struct Answer;

/// A client of one name service, or of registries that share their names: provides Directory's
/// operations and errors for one URL, or for several separated by ','.
/// @threads  any, concurrently
class Service {
 public:
  /// `deadline` bounds each request.
  Service(rpc::Node& node, std::string url, Duration deadline);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  [[nodiscard]] expected<Granted, DirectoryError> bind(const Claim& claim, bool replaces);
  /// Ends within `deadline`, counted from now.
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
  /// Reads the contents into `found` within `deadline` in total; after an error, `found` keeps what
  /// was received.
  [[nodiscard]] expected<void, DirectoryError> read(std::string_view directory,
                                                    MonotonicTime deadline, FoundNames& found);
  /// Adds the lapsed names to `found`, within `deadline` in total.
  /// @errors   the service keeps no lapsed names
  [[nodiscard]] expected<void, DirectoryError> read_lapsed(MonotonicTime deadline,
                                                           std::vector<LapsedName>& found);

  [[nodiscard]] const std::string& url() const noexcept { return url_; }

 private:
  struct Registry {
    std::string url{};
    std::shared_ptr<NamesClient> client{};
  };

  template <class Operation>
  [[nodiscard]] auto ask(MonotonicTime deadline, Operation operation);
  template <class Operation>
  [[nodiscard]] auto ask_at(Registry& registry, MonotonicTime deadline, Operation operation);
  template <class Operation>
  [[nodiscard]] expected<void, DirectoryError> confirm(MonotonicTime deadline,
                                                       std::string_view name, Operation operation);
  template <class Operation, class Take>
  [[nodiscard]] expected<void, DirectoryError> read_pages(std::string_view directory,
                                                          MonotonicTime deadline,
                                                          Operation operation, Take take);
  [[nodiscard]] DirectoryError refused(const Answer& answer, std::string_view name);
  [[nodiscard]] expected<std::shared_ptr<NamesClient>, DirectoryError> bound_client(
      Registry& registry, MonotonicTime deadline);
  void forget(Registry& registry, const std::shared_ptr<NamesClient>& client);
  [[nodiscard]] MonotonicTime usual_end() const;

  rpc::Node& node_;
  const std::string url_;
  const Duration deadline_;
  std::atomic<std::size_t> preferred_ = 0;
  std::mutex mutex_;  ///< Guards the clients; not for real-time threads.
  std::deque<Registry> registries_{};
};

}  // namespace rtpm::names
