#pragma once

/// Next steps after failures, as the system's users take them.
namespace rtpm::transport::os {

inline constexpr const char* kRemedyForDescriptors =
    "close other programs, or open fewer connections.";
inline constexpr const char* kRemedyForHostsDescriptors = kRemedyForDescriptors;
inline constexpr const char* kRemedyForMemory =
    "close other programs or enlarge the paging file, or configure less.";
inline constexpr const char* kRemedyForLoopback = "see whether TCP/IP is installed (ipconfig).";
inline constexpr const char* kRemedyForBusyPort =
    "end the program that has it (netstat -abno), or choose another port; 0 lets the system "
    "choose.";
inline constexpr const char* kRemedyForRefusedPort =
    "choose another port, or 0, which lets the system choose: a program has it for itself (netstat "
    "-abno), or Windows reserves it (netsh int ipv4 show excludedportrange protocol=udp).";
inline constexpr const char* kRemedyForRoute =
    "check the host, this host's routes (route print), and whether Windows' firewall lets the "
    "program through";

}  // namespace rtpm::transport::os
