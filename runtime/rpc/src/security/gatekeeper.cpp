#include "security/gatekeeper.hpp"

#include <array>
#include <utility>

#include "rtpm/access/files.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

expected<crypto::KeyPair, SetupError> read_or_make_key(const std::string& file) {
  auto path = access::key_file_path(file, access::kKeyFile);
  if (!path) return unexpected{path.error()};
  const auto is_there = [&] { return access::stamp_of(*path).is_of_file(); };
  if (is_there()) return access::read_key(*path);
  auto made = access::make_key(*path, access::user_at_host());
  // Another program may have created it meanwhile.
  if (!made && is_there()) return access::read_key(*path);
  return made;
}

}  // namespace

expected<Secret<sealed::ServerIdentity>, SetupError> open_identity(const std::string& file) {
  auto key = read_or_make_key(file);
  if (!key) return unexpected{key.error()};
  return Secret<sealed::ServerIdentity>::make(
      sealed::ServerIdentity{.key = std::move(*key), .preshared = {}});
}

expected<std::unique_ptr<Gatekeeper>, SetupError> Gatekeeper::open(const std::string& key_log_file,
                                                                   AccessControl& control,
                                                                   AuditLog& audit) {
  auto wait_set = transport::WaitSet::open(1);
  if (!wait_set) return unexpected{wait_set.error()};
  std::unique_ptr<Gatekeeper> gatekeeper(new Gatekeeper(std::move(*wait_set), control, audit));
  if (key_log_file.empty()) return gatekeeper;
  auto key_log = access::LogFile::open(key_log_file);
  if (!key_log) return unexpected{key_log.error()};
  gatekeeper->key_log_.emplace(std::move(*key_log));
  gatekeeper->log_.write("the keys of all sessions are written to " + printable(key_log_file) +
                         ": whoever reads that file reads their traffic");
  return gatekeeper;
}

expected<void, SetupError> Gatekeeper::start(std::vector<GatekeeperLink*> lanes,
                                             std::vector<int> cpus) {
  lanes_ = std::move(lanes);
  auto thread =
      rt::Thread::start({.name = "rtpm-gatekeeper", .cpus = std::move(cpus)}, [this] { run(); });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void Gatekeeper::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  wait_set_->ring();
  thread_.join();
}

void Gatekeeper::run() {
  std::array<transport::SourceTag, 1> ready{};
  MonotonicTime next_look = rt::now();
  while (!is_stopping_.load(std::memory_order_acquire)) {
    const bool has_worked = work_once();
    if (const MonotonicTime now = rt::now(); now >= next_look) {
      look();
      next_look = now + kLookInterval;
    }
    static_cast<void>(wait_set_->wait(has_worked ? transport::kAlready : next_look, ready));
  }
  audit_.write_notes();
}

// Runs one handshake step for each lane, so that a storm on one lane does not delay the others.
// False if there is none.
bool Gatekeeper::work_once() {
  bool has_worked = false;
  for (GatekeeperLink* const lane : lanes_) {
    const auto work = lane->take_submitted();
    if (!work) continue;
    work->job->run();
    write_key(*work->job);
    lane->give_back(*work);
    has_worked = true;
  }
  return has_worked;
}

void Gatekeeper::look() {
  // Before the reload, so that notes name the grants by which their callers were judged.
  audit_.write_notes();
  if (control_.reload_if_changed()) {
    audit_.note({AuditNote::Kind::kReloaded, {}, rt::now()});
    for (GatekeeperLink* const lane : lanes_)
      lane->ring();
  }
  for (GatekeeperLink* const lane : lanes_)
    lane->request_sweep();
  audit_.write_notes();
  log_.tick();
}

void Gatekeeper::write_key(const sealed::HandshakeJob& job) {
  if (!key_log_) return;
  const auto line = job.key_log_line();
  if (!line) return;
  if (auto written = key_log_->write_line(*line); !written) log_.write(written.error().text());
}

}  // namespace rtpm::rpc
