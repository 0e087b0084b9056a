#pragma once

#include <memory>
#include <string>
#include <vector>

#include "runs/contender.hpp"
#include "runs/peer_board.hpp"
#include "runs/peer_table.hpp"
#include "sides/server_process.hpp"

namespace rtpm::bench {

/// A peer with its server and its client, each a process, of which both are stopped but for the
/// peer's turns. Make it before this process starts a thread.
class PeerContender final : public Contender {
 public:
  /// `verb`: what the client does, "call" or "events".   Set-up only.
  [[nodiscard]] static expected<std::unique_ptr<PeerContender>, std::string> start(
      const PeerEntry& peer, const std::string& program, const std::string& verb,
      const PeerSetting& setting);
  ~PeerContender() override;

  [[nodiscard]] expected<void, std::string> take_turn(const TurnPlan& plan, Samples& high,
                                                      Samples& low) override;

  [[nodiscard]] std::string_view name() const noexcept { return name_; }
  [[nodiscard]] std::string_view transport() const noexcept {
    return board_->setting.transport.get();
  }
  /// Deliveries of events that did not come, in all turns so far.
  [[nodiscard]] std::uint64_t missing_count() const noexcept { return missing_count_; }

 private:
  PeerContender(std::string_view name, SharedBoard board) : name_(name), board_(std::move(board)) {}
  [[nodiscard]] expected<void, std::string> start_programs(const std::string& program,
                                                           const std::string& verb);

  std::string_view name_;
  SharedBoard board_;
  std::vector<ServerProcess> processes_{};  ///< The server and the client.
  std::uint64_t missing_count_ = 0;
};

/// "zeromq, ipc".
[[nodiscard]] std::string peer_title(std::string_view name, std::string_view transport);

}  // namespace rtpm::bench
