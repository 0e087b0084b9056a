#include <algorithm>
#include <string>

#include "survey/judgements.hpp"

// Judges the memory that the system gives to sockets, transports and programs.
namespace rtpm::rt {
namespace {

// The largest buffers that a transport requests: for receiving multicast, and for sending by TCP.
constexpr std::int64_t kReceiveMin = 4 * 1024 * 1024;
constexpr std::int64_t kSendMin = 1024 * 1024;

std::string mib_text(std::uint64_t size) {
  return std::to_string(size / (1024 * 1024)) + " MiB";
}

}  // namespace

Finding judge_socket_buffers(const HostFiles& files) {
  if (!files.rmem_max || !files.wmem_max) {
    return {"socket-buffers", Severity::kNote,
            "the system does not tell how large they may be (a network namespace of a container)"};
  }
  Finding finding{"socket-buffers", Severity::kWarning, "", "", ""};
  std::string settings;
  const auto want = [&](const char* name, std::int64_t now, std::int64_t size) {
    if (now >= size) return;
    finding.fixes.push_back({std::string("/proc/sys/net/core/") + name, std::to_string(size)});
    settings +=
        std::string(settings.empty() ? "" : " ") + "net.core." + name + "=" + std::to_string(size);
  };
  want("rmem_max", *files.rmem_max, kReceiveMin);
  want("wmem_max", *files.wmem_max, kSendMin);
  finding.text = "up to " + std::to_string(*files.rmem_max / 1024) + " KiB to receive, " +
                 std::to_string(*files.wmem_max / 1024) + " KiB to send";
  if (finding.fixes.empty()) return {"socket-buffers", Severity::kGood, finding.text};
  finding.cost =
      "a burst of UDP datagrams, such as a message of 1 MiB, is lost in part and sent "
      "again: some ms more";
  finding.remedy = "rtpm doctor --fix, or:\nsudo sysctl -w " + settings;
  finding.lasting = "printf '%s\\n' " + settings + " | sudo tee /etc/sysctl.d/90-rtpm.conf";
  return finding;
}

Finding judge_shared_memory(const HostAnswers& answers) {
  const std::string remedy =
      "sudo mount -o remount,size=1g /dev/shm; in a container: docker run --shm-size=1g";
  if (!answers.shared_memory_size) {
    return {"shared-memory", Severity::kWarning, "there is no /dev/shm",
            "hubs have no ring, so that each consumer takes a stream of its own: some 10 µs later",
            "sudo mkdir -p /dev/shm && sudo mount -t tmpfs tmpfs /dev/shm"};
  }
  const std::string text = "/dev/shm has " + mib_text(*answers.shared_memory_size) + ", " +
                           mib_text(answers.shared_memory_free) + " of them free";
  constexpr std::uint64_t kSizeMin = std::uint64_t{128}
                                     << 20;  // Docker's default of 64 MiB is soon full.
  constexpr std::uint64_t kFreeMin = std::uint64_t{32} << 20;
  if (*answers.shared_memory_size >= kSizeMin && answers.shared_memory_free >= kFreeMin) {
    return {"shared-memory", Severity::kGood, text};
  }
  return {"shared-memory", Severity::kWarning, text,
          "when it is full, servers refuse to start or serve by sockets, some 10 µs slower",
          remedy};
}

Finding judge_huge_pages(const HostFiles& files) {
  if (files.huge_pages != "always") {
    return {"huge-pages", Severity::kGood,
            files.huge_pages.empty()
                ? "the system has no transparent huge pages"
                : "transparent huge pages only where a program asks ('" + files.huge_pages + "')"};
  }
  return {"huge-pages",
          Severity::kWarning,
          "transparent huge pages are 'always' made",
          "the first touch of memory clears 2 MiB instead of 4 KiB, some 100 µs, and pages are "
          "moved while threads run",
          "rtpm doctor --fix, or:\necho madvise | sudo tee "
          "/sys/kernel/mm/transparent_hugepage/enabled",
          {{"/sys/kernel/mm/transparent_hugepage/enabled", "madvise"}},
          "echo 'w /sys/kernel/mm/transparent_hugepage/enabled - - - - madvise' | sudo tee "
          "/etc/tmpfiles.d/rtpm-huge-pages.conf"};
}

Finding judge_swap(const HostFiles& files, const HostAnswers& answers) {
  if (files.swap_kib == 0) return {"swap", Severity::kGood, "there is none"};
  const std::string text = "there are " + mib_text(files.swap_kib * 1024) + " of it";
  if (!answers.memory_lock_refusal) {
    return {"swap", Severity::kGood, text + ", which locked memory does not use"};
  }
  return {"swap", Severity::kWarning, text + ", and memory can't be locked",
          "a page that was swapped out costs a real-time thread some ms",
          "see memory-lock; until then: sudo swapoff -a"};
}

}  // namespace rtpm::rt
