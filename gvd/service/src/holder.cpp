#include "rtpm/gvd/holder.hpp"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <holder.rtpm.hpp>
#include <iterator>
#include <mutex>
#include <utility>
#include <vector>

#include "holder_introduction.hpp"
#include "holder_servant.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/caller.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kIntroduceDeadline = std::chrono::milliseconds{200};

std::string content_of(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string file_name_of(std::string_view path) {
  return std::string(path.substr(path.find_last_of('/') + 1));
}

/// The program of a command line whose arguments end with a zero byte each.
std::string program_of(std::string_view command_line) {
  std::vector<std::string_view> arguments;
  while (!command_line.empty()) {
    const std::size_t end = std::min(command_line.find('\0'), command_line.size());
    arguments.push_back(command_line.substr(0, end));
    command_line.remove_prefix(std::min(end + 1, command_line.size()));
  }
  if (arguments.empty()) return rt::program_name();
  const std::string program = file_name_of(arguments[0]);
  if (!program.starts_with("python") || arguments.size() < 2) return program;
  if (arguments[1] == "-m" && arguments.size() > 2) return std::string(arguments[2]);
  return arguments[1].starts_with('-') ? program : file_name_of(arguments[1]);
}

auto bind_holder(rpc::Node& node, std::string_view device_url) {
  rpc::BindOptions options;
  options.deadline = kIntroduceDeadline;
  return device::LeaseHolderClient::bind(node, holder_path(device_url), options);
}

void introduce_by(device::LeaseHolderClient& stub, std::uint64_t lease, std::string_view name) {
  device::IntroduceRequestT request;
  request.lease = lease;
  request.name = name;
  static_cast<void>(stub.introduce(request));
}

}  // namespace

std::string own_holder_name() {
  const std::string host = rt::host_name();
  // Not the program's name alone: it is Python's where a script runs.
  const std::string program = program_of(content_of("/proc/self/cmdline"));
  return printable(host.empty() ? program : program + " on " + host, kHolderNameSizeMax);
}

HolderIntroduction::HolderIntroduction(rpc::Node& node, std::string_view device_url)
    : name_(own_holder_name()) {
  if (auto stub = bind_holder(node, device_url)) stub_.emplace(std::move(*stub));
}

void HolderIntroduction::tell(std::uint64_t lease) {
  if (stub_) introduce_by(*stub_, lease, name_);
}

void introduce(rpc::Node& node, std::string_view device_url, std::uint64_t lease,
               std::string_view name) {
  if (auto stub = bind_holder(node, device_url)) introduce_by(*stub, lease, name);
}

rpc::Result<device::Outcome> HolderServant::introduce(const device::IntroduceRequest& request,
                                                      const rpc::CallContext& context) {
  if (request.lease() == Lease::kNobody || lease_.holder() != request.lease()) {
    return device::Outcome{device::OutcomeCode::NotHolder};
  }
  // Called once per lease, not in a loop.
  const rt::AllowAllocationScope set_up;
  Holder holder{.lease = request.lease(),
                .name = printable(request.name()->string_view(), kHolderNameSizeMax),
                .since = rt::now()};
  if (context.identity != nullptr) {
    holder.key_name = printable(context.identity->name(), kHolderNameSizeMax);
  }
  const std::lock_guard lock(mutex_);
  // A holder that changes its name has the lease since it had the first one.
  if (holder_.lease == holder.lease) holder.since = holder_.since;
  holder_ = std::move(holder);
  return device::Outcome{device::OutcomeCode::Done};
}

rpc::Result<void> HolderServant::holder(rpc::ReplyBuilder<device::HolderReply>& reply,
                                        const rpc::CallContext&) {
  // For people, about once a second.
  const rt::AllowAllocationScope set_up;
  const std::uint64_t current = lease_.holder();
  Holder holder;
  {
    const std::lock_guard lock(mutex_);
    if (current != Lease::kNobody && holder_.lease == current) holder = holder_;
  }
  const auto held = holder.lease == Lease::kNobody ? Duration{0} : rt::now() - holder.since;
  flatbuffers::FlatBufferBuilder& builder = reply.builder();
  const auto name = builder.CreateString(holder.name);
  const auto key_name = builder.CreateString(holder.key_name);
  reply.finish(device::CreateHolderReply(
      builder, current != Lease::kNobody, name, key_name,
      static_cast<std::uint64_t>(
          std::chrono::duration_cast<std::chrono::microseconds>(held).count())));
  return {};
}

}  // namespace rtpm::gvd
