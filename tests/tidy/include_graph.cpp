#include "include_graph.hpp"

#include <algorithm>
#include <optional>
#include <regex>
#include <set>
#include <string>
#include <string_view>

namespace rtpm::tidy {
namespace {

/// A part of the project: its folder, the name of its headers' folder under rtpm/, and the parts
/// that it may include besides itself. In layers, from the bottom up.
struct Part {
  std::string_view folder;
  std::string_view name;
  std::vector<std::string_view> below;
  bool may_include_everything = false;
};

const std::vector<Part>& parts() {
  static const std::vector<Part> kParts{
      {"protocol/base/", "base", {}},
      {"protocol/crypto/", "crypto", {"base"}},
      {"protocol/wire/", "wire", {"base"}},
      {"protocol/sealed/", "sealed", {"base", "crypto", "wire"}},
      {"runtime/access/", "access", {"base", "crypto", "wire"}},
      {"runtime/rt/", "rt", {"base"}},
      {"runtime/transport/", "transport", {"base", "wire", "rt"}},
      {"runtime/rpc/", "rpc", {"base", "wire", "rt", "transport", "access", "crypto", "sealed"}},
      {"runtime/program/", "program", {"base", "rt"}},
      {"runtime/options/",
       "options",
       {"base", "wire", "rt", "transport", "rpc", "access", "program"}},
      {"runtime/introspection/", "introspection", {"base", "wire", "rt", "rpc"}},
      {"runtime/dynamic/",
       "dynamic",
       {"base", "wire", "rt", "rpc", "program", "introspection", "schema"}},
      {"registry/predicate/", "predicate", {"base", "program"}},
      {"registry/discovery/", "discovery", {"base", "wire", "rt", "transport"}},
      {"registry/names/",
       "names",
       {"base", "wire", "rt", "transport", "access", "rpc", "program", "predicate", "discovery"}},
      {"registry/file_store/", "file_store", {"base", "rt", "predicate", "names"}},
      {"registry/etcd_store/", "etcd_store", {"base", "rt", "names", "file_store"}},
      {"registry/events/",
       "events",
       {"base", "wire", "rt", "transport", "rpc", "program", "options", "predicate", "names",
        "introspection"}},
      {"registry/asio/", "asio", {"base", "rt", "rpc", "names", "events"}},
      {"registry/daemon/",
       "",
       {"base", "wire", "rt", "transport", "rpc", "program", "options", "predicate", "discovery",
        "names", "file_store", "etcd_store", "introspection"}},
      {"gvd/driver/", "driver", {"base"}},
      {"gvd/driver_host/", "driver_host", {"base", "rt", "driver"}},
      {"gvd/configuration/", "configuration", {"base", "rt", "rpc", "driver"}},
      {"gvd/models/", "models", {"base", "driver"}},
      {"gvd/safety/", "safety", {"base", "driver"}},
      {"gvd/viewers/", "viewers", {"base", "driver", "models"}},
      {"gvd/ros2/", "ros2", {"base", "crypto", "driver"}},
      {"gvd/vrpn/", "vrpn", {"base", "driver"}},
      {"gvd/media/", "media", {"base", "wire", "rt", "rpc"}},
      {"gvd/incidents/", "incidents", {"base", "rt"}},
      {"gvd/recording/file/", "recording", {"base", "rt"}},
      {"gvd/recording/capture/",
       "capture",
       {"base", "wire", "rt", "rpc", "names", "introspection", "dynamic", "events", "recording",
        "schema", "driver", "models", "configuration", "safety", "viewers", "gvd", "media"}},
      {"gvd/recording/play/",
       "replay",
       {"base", "rt", "rpc", "program", "names", "introspection", "events", "recording", "driver",
        "safety", "gvd", "capture"}},
      {"gvd/recording/export/",
       "exports",
       {"base", "rpc", "program", "events", "recording", "schema", "driver", "gvd", "capture",
        "ros2", "viewers"}},
      {"gvd/",
       "gvd",
       {"base", "wire", "rt", "rpc", "predicate", "names", "events", "driver", "configuration",
        "models", "safety"}},
      {"devices/mpv/plugin/",
       "",
       {"base", "rpc", "rt", "names", "introspection", "events", "driver", "gvd", "device_io",
        "device_mpv"}},
      {"devices/io/", "device_io", {"base", "rt", "driver"}},
      {"devices/mpv/", "device_mpv", {"base", "rt", "driver", "device_io"}},
      {"devices/evdev/", "device_evdev", {"base", "rt", "driver", "device_io"}},
      {"devices/falcon/", "device_falcon", {"base", "rt", "driver", "device_io"}},
      {"devices/hid/", "device_hid", {"base", "rt", "driver", "device_io"}},
      {"devices/serial/", "device_serial", {"base", "rt", "driver", "device_io"}},
      {"devices/sim/", "device_sim", {"base", "driver"}},
      {"devices/vrpn/", "device_vrpn", {"base", "rt", "driver", "vrpn", "device_io"}},
      {"devices/", "", {"base",          "wire",       "rt",          "rpc",
                        "program",       "options",    "names",       "introspection",
                        "events",        "driver",     "driver_host", "configuration",
                        "safety",        "gvd",        "media",       "device_evdev",
                        "device_falcon", "device_hid", "device_io",   "device_mpv",
                        "device_serial", "device_sim", "device_vrpn", "capture"}},
      {"clients/console/",
       "",
       {"base",          "wire",          "rt",      "rpc",    "program",   "options", "predicate",
        "names",         "introspection", "dynamic", "events", "recording", "schema",  "driver",
        "configuration", "models",        "viewers", "media",  "gvd",       "capture", "replay",
        "exports",       "incidents"}},
      {"clients/mqtt/",
       "",
       {"base", "rt", "transport", "rpc", "program", "options", "names", "events"}},
      {"clients/ros2/",
       "",
       {"base", "rt", "rpc", "program", "options", "names", "events", "driver", "gvd", "ros2"}},
      {"clients/c/",
       "rtpm.h",
       {"base", "rt", "rpc", "names", "dynamic", "events", "recording", "schema", "driver", "gvd",
        "capture"}},
      {"clients/python/",
       "",
       {"base", "wire", "rt", "rpc", "predicate", "names", "introspection", "dynamic", "events",
        "recording", "schema", "driver", "models", "gvd", "capture"}},
      {"clients/rtpm/",
       "",
       {"base",          "wire",          "rt",        "transport", "rpc",
        "program",       "options",       "predicate", "discovery", "names",
        "introspection", "dynamic",       "events",    "recording", "schema",
        "driver",        "configuration", "safety",    "gvd",       "capture",
        "replay",        "exports",       "access",    "crypto",    "incidents"}},
      {"clients/vrpn/",
       "",
       {"base", "transport", "rpc", "rt", "program", "options", "names", "driver", "gvd", "vrpn"}},
      {"clients/",
       "",
       {"base", "wire", "rt", "rpc", "program", "options", "names", "introspection", "events",
        "driver", "configuration", "models", "gvd"}},
      {"examples/", "", {"base", "rt", "rpc", "program", "options", "names", "driver", "gvd"}},
      {"schema/", "schema", {}},
      {"bench/", "", {}, true},
      {"tests/", "", {}, true},
  };
  return kParts;
}

/// The order inside a part: a folder of it, and the sub-folders there from the bottom up, as a file
/// includes only its own sub-folder and those before it. The files beside them stand under "".
struct Order {
  std::string_view folder;
  std::vector<std::string_view> sub_folders;
};

const std::vector<Order>& orders() {
  static const std::vector<Order> kOrders{
      {"runtime/rpc/src/",
       {"", "model", "local", "tap", "security", "media", "calls", "execution", "lane", "server",
        "client"}},
      {"registry/names/src/", {"model", "store", "servant", "client", "finding"}},
      {"schema/compiler/src/",
       {"model", "reading", "checks", "text", "emit", "cpp", "java", "python", "typescript",
        "program"}},
  };
  return kOrders;
}

/// Headers of other projects and the parts that may know them; bench/ and tests/ may know all.
struct Foreign {
  std::regex header;
  std::string_view what;
  std::vector<std::string_view> folders;
};

const std::vector<Foreign>& foreigners() {
  static const std::vector<Foreign> kForeigners{
      {std::regex("flatbuffers/.*"),
       "FlatBuffers",
       {"schema/", "runtime/rpc/", "clients/python/src/"}},
      {std::regex("Eigen/.*"), "Eigen", {"devices/falcon/", "devices/sim/"}},
      {std::regex("nlohmann/.*"),
       "nlohmann/json",
       {"schema/compiler/src/", "registry/file_store/src/", "registry/etcd_store/src/",
        "gvd/configuration/src/", "gvd/incidents/src/", "gvd/recording/export/src/",
        "gvd/recording/file/src/", "devices/mpv/src/", "clients/c/src/", "clients/console/",
        "clients/rtpm/"}},
      {std::regex("dds/.*"), "Cyclone DDS", {"clients/ros2/src/cyclone/"}},
      {std::regex("(mosquitto|mqtt_protocol).*"), "libmosquitto", {"clients/mqtt/"}},
      {std::regex("(zlib|zstd|lz4frame)\\.h"),
       "zlib, zstd and lz4",
       {"gvd/recording/file/src/", "gvd/recording/export/src/"}},
      {std::regex("sqlite3.*"), "SQLite", {"registry/file_store/src/"}},
      {std::regex("sodium.*"), "libsodium", {"protocol/crypto/src/"}},
      {std::regex("curl/.*"), "libcurl", {"registry/etcd_store/src/"}},
      {std::regex("mpv/.*"), "libmpv", {"devices/mpv/plugin/"}},
      {std::regex("gst/.*"), "GStreamer", {"devices/camera/"}},
      {std::regex("libusb.*"), "libusb", {"devices/falcon/src/"}},
      {std::regex("hidapi.*"), "hidapi", {"devices/hid/src/"}},
      {std::regex("libserialport\\.h"), "libserialport", {"devices/serial/src/"}},
      {std::regex("(libevdev/.*|libudev\\.h)"), "libevdev and libudev", {"devices/"}},
      {std::regex("(gtest|gmock)/.*"), "GoogleTest", {}},
      {std::regex("benchmark/.*"), "Google Benchmark", {}},
      {std::regex("CLI/.*"), "CLI11", {"clients/rtpm/", "runtime/options/src/"}},
      {std::regex("toml.*"), "toml++", {"clients/rtpm/laboratory/", "runtime/options/src/"}},
      {std::regex("n?curses.*"), "ncurses", {"clients/rtpm/host/"}},
      {std::regex("asio/.*"), "Asio", {"registry/asio/"}},
      {std::regex("boost/.*"), "Boost", {"clients/console/web/", "registry/asio/"}},
      {std::regex("nanobind/.*"), "nanobind", {"clients/python/src/"}},
      // program has the signals and streams that every program shares, options the environment;
      // driver_host loads plug-ins; the devices are drivers of hardware and a program that
      // devices/mpv starts; rtpm looks at terminals, files and this host; the console names the
      // host, and needs random numbers; event loops of C and Python wait for descriptors, and Python
      // forks; VRPN has a protocol of its own on sockets.
      {std::regex("((sys|net|netinet|arpa|linux|asm)/.*|(unistd|pthread|sched|poll|fcntl|signal|"
                  "spawn|dirent|dlfcn|netdb|ifaddrs|termios|malloc|pwd|windows|winsock2|ws2tcpip|"
                  "aclapi|sddl|lmcons|io)\\.h)"),
       "the operating system",
       {"runtime/access/src/os/",
        "runtime/rt/src/os/",
        "runtime/transport/src/os/",
        "runtime/program/src/os/",
        "runtime/options/src/os/",
        "gvd/driver_host/src/",
        "gvd/recording/file/src/",
        "gvd/recording/export/src/os/",
        "gvd/incidents/src/",
        "devices/evdev/src/",
        "devices/falcon/src/",
        "devices/hid/src/",
        "devices/io/src/",
        "devices/mpv/src/",
        "devices/serial/src/",
        "devices/vrpn/src/",
        "clients/c/src/",
        "clients/console/",
        "clients/python/src/",
        "clients/rtpm/",
        "clients/vrpn/src/"}},
  };
  return kForeigners;
}

bool is_under(std::string_view path, std::string_view folder) {
  return path.starts_with(folder);
}

const Part* part_of(std::string_view path) {
  for (const Part& part : parts()) {
    if (is_under(path, part.folder)) return &part;
  }
  return nullptr;
}

std::string list_of(const Part& part) {
  std::string list(part.name);
  for (const std::string_view name : part.below) {
    if (!list.empty()) list += ", ";
    list += name;
  }
  return list;
}

struct Include {
  std::string header;
  bool is_quoted = false;
};

std::optional<Include> include_in(const std::string& line) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"])");
  std::smatch match;
  if (!std::regex_search(line, match, kInclude)) return std::nullopt;
  return Include{match[2], match[1] == "\""};
}

/// Returns why `include` is wrong in a file of `part`, empty if it is right.
std::string check_own(const Part& part, std::string_view header) {
  if (part.may_include_everything || !header.starts_with("rtpm/")) return {};
  const std::string_view rest = header.substr(5);
  const std::string_view wanted = rest.substr(0, rest.find('/'));
  if (wanted == part.name) return {};
  if (std::find(part.below.begin(), part.below.end(), wanted) != part.below.end()) return {};
  return "includes " + std::string(header) + ", which is not below " + std::string(part.folder) +
         "; it may include: " + list_of(part);
}

std::string check_foreign(const SourceFile& file, std::string_view header) {
  for (const Foreign& foreign : foreigners()) {
    if (!std::regex_match(header.begin(), header.end(), foreign.header)) continue;
    const bool is_allowed =
        std::any_of(foreign.folders.begin(), foreign.folders.end(),
                    [&](std::string_view folder) { return is_under(file.path, folder); });
    if (is_allowed) return {};
    return "includes " + std::string(header) + ", but " + std::string(foreign.what) +
           " is not for " + file.path.substr(0, file.path.rfind('/') + 1);
  }
  return {};
}

/// A quoted header that is not RTPM's public one must be the part's own: beside the file or in the
/// part's src/.
std::string check_private(const SourceFile& file, const Part& part, std::string_view header,
                          const std::set<std::string>& paths) {
  if (header.starts_with("rtpm/") || header.ends_with(".rtpm.hpp")) return {};
  const std::string beside = file.path.substr(0, file.path.rfind('/') + 1) + std::string(header);
  if (paths.contains(beside)) return {};
  const std::string suffix = "/" + std::string(header);
  const bool is_in_part = std::any_of(paths.begin(), paths.end(), [&](const std::string& path) {
    return is_under(path, part.folder) && path.ends_with(suffix);
  });
  if (is_in_part) return {};
  return "includes \"" + std::string(header) + "\", which is no header of " +
         std::string(part.folder);
}

/// The sub-folder of `path` in `folder`, which holds it.
std::string_view sub_folder_of(std::string_view path, std::string_view folder) {
  const std::string_view below = path.substr(folder.size());
  return below.substr(0, below.find('/') == std::string_view::npos ? 0 : below.find('/'));
}

/// Returns why `header` is wrong in `file`, as one of a sub-folder above; empty if it is right.
std::string check_order(const SourceFile& file, std::string_view header,
                        const std::set<std::string>& paths) {
  for (const auto& [folder, sub_folders] : orders()) {
    if (!is_under(file.path, folder)) continue;
    const std::string beside = file.path.substr(0, file.path.rfind('/') + 1) + std::string(header);
    const std::string included =
        paths.contains(beside) ? beside : std::string(folder) + std::string(header);
    if (!paths.contains(included)) continue;
    const auto own = std::ranges::find(sub_folders, sub_folder_of(file.path, folder));
    const auto wanted = std::ranges::find(sub_folders, sub_folder_of(included, folder));
    if (own == sub_folders.end() || wanted == sub_folders.end()) {
      return "has a sub-folder of " + std::string(folder) +
             " without a place in its order; give it one in tests/tidy/include_graph.cpp";
    }
    if (wanted > own) {
      return "includes \"" + std::string(header) + "\", which is above " + std::string(folder) +
             std::string(*own);
    }
  }
  return {};
}

}  // namespace

std::vector<Fault> find_forbidden_includes(const std::vector<SourceFile>& files) {
  std::vector<Fault> faults;
  std::set<std::string> paths;
  for (const SourceFile& file : files)
    paths.insert(file.path);
  for (const SourceFile& file : files) {
    if (!is_cpp(file)) continue;
    const Part* part = part_of(file.path);
    if (part == nullptr) {
      faults.push_back(file.path +
                       ": is in no part of the house; name the part in "
                       "tests/tidy/include_graph.cpp");
      continue;
    }
    const std::vector<std::string> lines = lines_of(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto include = include_in(lines[i]);
      if (!include) continue;
      std::string wrong = check_own(*part, include->header);
      if (wrong.empty() && !part->may_include_everything) {
        wrong = check_foreign(file, include->header);
        if (wrong.empty() && include->is_quoted) {
          wrong = check_private(file, *part, include->header, paths);
          if (wrong.empty()) wrong = check_order(file, include->header, paths);
        }
      }
      if (!wrong.empty()) faults.push_back(fault_at(file, i, wrong));
    }
  }
  return faults;
}

}  // namespace rtpm::tidy
