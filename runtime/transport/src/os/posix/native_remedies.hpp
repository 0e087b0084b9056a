#pragma once

/// Next steps after failures, as the system's users take them.
namespace rtpm::transport::os {

inline constexpr const char* kRemedyForDescriptors =
    "raise the limit of open files (ulimit -n; LimitNOFILE= of a systemd unit), or open fewer.";
inline constexpr const char* kRemedyForHostsDescriptors =
    "raise the host's limit of open files (sysctl fs.file-max), or end other programs.";
inline constexpr const char* kRemedyForMemory =
    "raise the limit of memory (ulimit -v; MemoryMax= of a systemd unit), or free some.";
inline constexpr const char* kRemedyForLoopback =
    "bring the loopback interface up: sudo ip link set dev lo up.";
inline constexpr const char* kRemedyForBusyPort =
    "end the program that has it (ss -lptun), or choose another port; 0 lets the system choose.";
inline constexpr const char* kRemedyForRefusedPort =
    "choose a port from 1024 on, or 0, which lets the system choose; lower ones need root, or "
    "CAP_NET_BIND_SERVICE.";
inline constexpr const char* kRemedyForRoute = "check the host, and this host's routes (ip route)";

}  // namespace rtpm::transport::os
