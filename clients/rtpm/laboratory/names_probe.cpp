#include "laboratory/names_probe.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <chrono>
#include <optional>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::laboratory {
namespace {

constexpr auto kPeriod = std::chrono::milliseconds{50};
constexpr auto kDeadline = std::chrono::milliseconds{500};

}  // namespace

NamesProbe::NamesProbe() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = std::thread([this] { run(); });
}

NamesProbe::~NamesProbe() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void NamesProbe::ask(const std::string& url) {
  {
    const std::lock_guard lock(mutex_);
    if (url == url_) return;
    url_ = url;
    answer_.clear();
  }
  changed_.notify_one();
}

NamesProbe::Revisions NamesProbe::take() {
  std::uint64_t count = 0;
  static_cast<void>(!::read(event_.number(), &count, sizeof count));
  const std::lock_guard lock(mutex_);
  return answer_;
}

void NamesProbe::run() {
  std::optional<rpc::Node> node;  // The node, made at its first use.
  std::unique_lock lock(mutex_);
  while (!is_ending_) {
    if (url_.empty()) {
      changed_.wait(lock);
      continue;
    }
    const std::string url = url_;
    lock.unlock();
    if (!node) node.emplace(rpc::NodeConfig{.wait = {.strategy = rt::WaitStrategy::kBlock}});
    const auto entries = names::Directory(*node, url, kDeadline).list();
    lock.lock();
    if (entries && url == url_) {
      answer_.clear();
      for (const names::NameEntry& entry : *entries)
        answer_[entry.name] = entry.revision;
      constexpr std::uint64_t kOne = 1;
      static_cast<void>(!::write(event_.number(), &kOne, sizeof kOne));
    }
    if (!is_ending_) changed_.wait_for(lock, kPeriod);
  }
}

}  // namespace rtpm::laboratory
