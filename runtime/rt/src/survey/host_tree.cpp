#include "survey/host_tree.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

namespace rtpm::rt {
namespace {

constexpr std::size_t kTextSizeMax = std::size_t{1} << 20;
// More than any current machine has.
constexpr std::int64_t kCpuCountMax = 8192;

bool is_before(const std::string& a, const std::string& b) {
  const auto end_of = [](const std::string& text) {
    const std::size_t digits = text.find_first_of("0123456789");
    return digits == std::string::npos ? text.size() : digits;
  };
  const std::size_t end = end_of(a);
  if (end != end_of(b) || a.compare(0, end, b, 0, end) != 0) return a < b;
  const auto first = number_of(std::string_view(a).substr(end));
  const auto second = number_of(std::string_view(b).substr(end));
  return first && second ? *first < *second : a < b;
}

}  // namespace

std::string HostTree::text(const std::string& path) const {
  std::ifstream file(root_ + path, std::ios::binary);
  std::string text;
  std::array<char, 4096> block{};
  while (file && text.size() < kTextSizeMax) {
    file.read(block.data(), block.size());
    text.append(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  while (text.ends_with('\n'))
    text.pop_back();
  return text;
}

std::optional<std::int64_t> HostTree::number(const std::string& path) const {
  return number_of(text(path));
}

bool HostTree::has(const std::string& path) const {
  std::error_code error;
  return std::filesystem::exists(root_ + path, error);
}

std::string HostTree::link(const std::string& path) const {
  std::error_code error;
  return std::filesystem::read_symlink(root_ + path, error).string();
}

std::vector<std::string> HostTree::entries(const std::string& path, std::string_view prefix) const {
  std::error_code error;
  std::vector<std::string> names;
  std::filesystem::directory_iterator entry(root_ + path, error);
  for (; !error && entry != std::filesystem::directory_iterator{}; entry.increment(error)) {
    std::string name = entry->path().filename().string();
    if (name.starts_with(prefix)) names.push_back(std::move(name));
  }
  std::ranges::sort(names, is_before);
  return names;
}

std::vector<int> HostTree::process_ids() const {
  std::vector<int> ids;
  for (const std::string& name : entries("/proc")) {
    if (const auto id = number_of(name)) ids.push_back(static_cast<int>(*id));
  }
  return ids;
}

std::optional<std::int64_t> number_of(std::string_view text, int base) noexcept {
  std::int64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number, base);
  if (read.ec != std::errc{} || read.ptr != end) return std::nullopt;
  return number;
}

std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin < text.size();) {
    begin = text.find_first_not_of(" \t\n", begin);
    if (begin == text.npos) break;
    const std::size_t end = std::min(text.find_first_of(" \t\n", begin), text.size());
    words.emplace_back(text.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::vector<int> parse_cpu_list(std::string_view text) {
  std::vector<int> cpus;
  while (!text.empty()) {
    const std::string_view part = text.substr(0, text.find(','));
    text.remove_prefix(std::min(part.size() + 1, text.size()));
    const std::size_t dash = std::min(part.find('-'), part.size());
    const auto first = number_of(part.substr(0, dash));
    const auto last = dash == part.size() ? first : number_of(part.substr(dash + 1));
    if (!first || !last || *first < 0 || *last >= kCpuCountMax) continue;
    for (std::int64_t cpu = *first; cpu <= *last; ++cpu)
      cpus.push_back(static_cast<int>(cpu));
  }
  return united(cpus, {});
}

std::string cpu_list_text(const std::vector<int>& cpus) {
  std::string text;
  for (std::size_t i = 0; i < cpus.size();) {
    std::size_t last = i;
    while (last + 1 < cpus.size() && cpus[last + 1] == cpus[last] + 1)
      ++last;
    text += (text.empty() ? "" : ",") + std::to_string(cpus[i]);
    if (last > i) text += (last == i + 1 ? "," : "-") + std::to_string(cpus[last]);
    i = last + 1;
  }
  return text;
}

std::vector<int> united(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> all = a;
  all.insert(all.end(), b.begin(), b.end());
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

std::vector<int> common(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> both;
  std::ranges::set_intersection(united(a, {}), united(b, {}), std::back_inserter(both));
  return both;
}

std::vector<int> without(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> rest;
  std::ranges::set_difference(united(a, {}), united(b, {}), std::back_inserter(rest));
  return rest;
}

}  // namespace rtpm::rt
