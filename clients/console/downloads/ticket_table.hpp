#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "downloads/download.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "web/token.hpp"

namespace rtpm::console {

/// Downloads that wait for their browsers. A ticket has 192 random bits, and is good for a minute
/// and for one use.
/// @threads  the web server's thread
class TicketTable {
 public:
  static constexpr std::size_t kCountMax = 16;
  static constexpr Duration kLifetime = std::chrono::minutes{1};

  /// @return   the ticket
  /// @errors   too many tickets are open; the system provides no random numbers
  [[nodiscard]] expected<std::string, SetupError> add(std::uint64_t connection_id,
                                                      Download download, MonotonicTime now) {
    expire(now);
    if (tickets_.size() >= kCountMax) {
      return setup_error("too many downloads wait to be fetched", "",
                         "wait a minute, or fetch them");
    }
    auto ticket = make_token();
    if (ticket) tickets_[*ticket] = {connection_id, now + kLifetime, std::move(download)};
    return ticket;
  }

  [[nodiscard]] std::optional<Download> take(std::string_view ticket, MonotonicTime now) {
    expire(now);
    // All are compared, in a time that depends on no ticket.
    auto found = tickets_.end();
    for (auto each = tickets_.begin(); each != tickets_.end(); ++each) {
      if (is_same_token(each->first, ticket)) found = each;
    }
    if (found == tickets_.end()) return std::nullopt;
    Download download = std::move(found->second.download);
    tickets_.erase(found);
    return download;
  }

  /// Drops the tickets that are too old.
  void expire(MonotonicTime now) {
    std::erase_if(tickets_, [now](const auto& one) { return one.second.end <= now; });
  }
  /// Drops the tickets of a connection.
  void drop(std::uint64_t connection_id) {
    std::erase_if(tickets_, [connection_id](const auto& one) {
      return one.second.connection_id == connection_id;
    });
  }
  [[nodiscard]] std::size_t size() const noexcept { return tickets_.size(); }

 private:
  struct Ticket {
    std::uint64_t connection_id = 0;
    MonotonicTime end{};
    Download download{};
  };
  std::map<std::string, Ticket> tickets_{};
};

}  // namespace rtpm::console
