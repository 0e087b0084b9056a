#pragma once

#include "execution/execution.hpp"
#include "execution/thread_pool.hpp"

namespace rtpm::rpc {

/// Several threads: one leads and orders calls by priority; the others run them, and can run calls
/// of higher lanes that lack threads.
class PooledExecution final : public Execution {
 public:
  /// @param number  the lane's index, in ascending order of bands
  /// @param lower   the pool that it may borrow threads from, or null
  PooledExecution(const LaneParts& parts, std::uint32_t number, PooledExecution* lower,
                  std::uint32_t call_count_max, transport::WaitSet& acceptor);

  void join() noexcept override;
  void maintain_threads() noexcept override;
  [[nodiscard]] ConstBytes accept(Lead&, wire::ServerSessions& sessions,
                                  const wire::Request& request) noexcept override;
  void accept(Lead&, LocalChannel& channel) noexcept override;
  [[nodiscard]] bool only_orders() const noexcept override { return true; }
  [[nodiscard]] transport::WaitLock* lock() noexcept override { return &pool_; }
  [[nodiscard]] bool yields_lead(Lead&) noexcept override;
  void sleep(Lead&, MonotonicTime until) noexcept override;
  void refuse_waiting(Lead&) noexcept override;
  [[nodiscard]] bool is_running(Lead&) const noexcept override { return pool_.running_count() > 0; }
  void end(Lead&) noexcept override { pool_.end(); }

 private:
  [[nodiscard]] expected<void, SetupError> start_threads() override;
  [[nodiscard]] expected<rt::Thread, SetupError> start_worker(Worker& worker, std::uint32_t index);
  void work(Worker& me) noexcept;
  [[nodiscard]] PooledExecution* next_borrower() noexcept;
  void help(PooledExecution& borrower, PendingCall* call) noexcept;
  void run_borrowed(PendingCall* call, ThreadPool& lender) noexcept;
  void run(PendingCall& call, ThreadPool* lender) noexcept;
  void end_run(Lead&, PendingCall& call, const Ran& ran, bool is_deferred) noexcept;
  void find_help(Lead&) noexcept;
  [[nodiscard]] BorrowedThread borrow() noexcept;
  [[nodiscard]] PendingCall* take_place() noexcept;
  [[nodiscard]] bool enqueue(Lead&, PendingCall& call, const Target& target) noexcept;
  [[nodiscard]] wire::Status refuse(Lead&) noexcept;

  std::uint32_t number_;
  PooledExecution* lower_;
  PooledExecution* upper_ = nullptr;
  transport::WaitSet& acceptor_;
  ThreadPool pool_;
};

}  // namespace rtpm::rpc
