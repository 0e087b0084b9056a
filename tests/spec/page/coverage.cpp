#include "coverage.hpp"

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <utility>

namespace rtpm::spec {
namespace {

constexpr std::string_view kPages[] = {"spec/hprotocol.md", "spec/events.md", "spec/security.md"};
constexpr std::string_view kExemptions = "spec/exemptions.txt";

/// The places where a citation counts.
enum class Place { kCode, kTest };
constexpr Place kPlaces[] = {Place::kCode, Place::kTest};

std::string_view to_string(Place place) {
  return place == Place::kCode ? "code" : "test";
}

const SourceFile& file_of(const std::vector<SourceFile>& files, std::string_view path) {
  static const SourceFile kNone{};
  const auto found = std::ranges::find(files, path, &SourceFile::path);
  return found == files.end() ? kNone : *found;
}

bool says_must(std::string_view text) {
  return text.find("MUST") != std::string_view::npos;
}

/// A rule's text goes from its anchor to the next item, empty line or heading.
bool ends_rule(std::string_view line) {
  return line.empty() || line.starts_with("- ") || line.starts_with("#") || line.starts_with("|");
}

struct Page {
  std::vector<Rule> rules;
  std::set<std::string> sections;   ///< Anchors of headings.
  std::vector<std::size_t> strays;  ///< Lines with a MUST outside any anchor's rule.
};

Page read_page(std::string_view text) {
  static const std::regex kRule(R"(^- `\[((?:hp|ev|sec)-[0-9.]+-[0-9]+)\]`)");
  static const std::regex kSection(R"(\{#((?:hp|ev|sec)-[0-9.]+)\})");
  Page page;
  bool is_in_rule = false;
  bool is_in_section = false;  // The text before the first section only defines MUST.
  const std::vector<std::string> lines = tidy::lines_of(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::smatch match;
    if (ends_rule(lines[i])) is_in_rule = false;
    if (std::regex_search(lines[i], match, kSection)) {
      page.sections.insert(match[1]);
      is_in_section = true;
    }
    if (std::regex_search(lines[i], match, kRule)) {
      page.rules.push_back({match[1], i, false});
      is_in_rule = true;
    }
    if (!says_must(lines[i])) continue;
    if (is_in_rule) {
      page.rules.back().is_must = true;
    } else if (is_in_section) {
      page.strays.push_back(i);
    }
  }
  return page;
}

/// Calls `take(anchor)` for each anchor in `text`.
template <class Take>
void for_each_anchor(const std::string& text, const Take& take) {
  static const std::regex kAnchor(R"(\b(hp|ev|sec)-[0-9]+(\.[0-9]+)*(-[0-9]+)?)");
  for (std::sregex_iterator match(text.begin(), text.end(), kAnchor), end; match != end; ++match) {
    take(match->str());
  }
}

bool is_code(const SourceFile& file) {
  return file.path.starts_with("protocol/") || file.path.starts_with("runtime/") ||
         file.path.starts_with("registry/") || file.path.starts_with("clients/mqtt/");
}

// This check's own files mention anchors without testing any rule.
bool is_test(const SourceFile& file) {
  return file.path.starts_with("tests/") && !file.path.starts_with("tests/spec/page/coverage");
}

bool is_vector(const SourceFile& file) {
  return file.path.starts_with("spec/vectors/") && file.path.ends_with(".json");
}

/// The part of a line that may have a citation: C++ comments, and all of a vector.
std::string citing_part(const SourceFile& file, const std::string& line) {
  if (is_vector(file)) return line;
  const std::size_t comment = line.find("//");
  return comment == std::string::npos ? std::string() : line.substr(comment);
}

struct Citations {
  std::map<Place, std::set<std::string>> anchors;
  std::vector<Fault> faults;
};

Citations read_citations(const std::vector<SourceFile>& files, const std::set<std::string>& known) {
  Citations citations;
  for (const SourceFile& file : files) {
    const bool is_source = tidy::is_cpp(file) && (is_code(file) || is_test(file));
    if (!is_source && !is_vector(file)) continue;
    const Place place = is_code(file) ? Place::kCode : Place::kTest;
    const std::vector<std::string> lines = tidy::lines_of(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto has = [&](const char* prefix) {
        return lines[i].find(prefix) != std::string::npos;
      };
      if (!has("hp-") && !has("ev-") && !has("sec-")) continue;
      for_each_anchor(citing_part(file, lines[i]), [&](const std::string& anchor) {
        if (known.contains(anchor)) {
          citations.anchors[place].insert(anchor);
        } else {
          citations.faults.push_back(
              tidy::fault_at(file, i, "cites " + anchor + ", which the page does not have"));
        }
      });
    }
  }
  return citations;
}

struct Exemption {
  std::string anchor;
  std::string place;
  std::size_t line_index = 0;
};

std::vector<Exemption> read_exemptions(const SourceFile& file, std::vector<Fault>& faults) {
  static const std::regex kLine(R"(^((?:hp|ev|sec)-[0-9.]+-[0-9]+) (code|test): (\S.*\s\S.*)$)");
  std::vector<Exemption> exemptions;
  const std::vector<std::string> lines = tidy::lines_of(file.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].empty() || lines[i].starts_with("#")) continue;
    std::smatch match;
    if (std::regex_match(lines[i], match, kLine)) {
      exemptions.push_back({match[1], match[2], i});
    } else {
      faults.push_back(
          tidy::fault_at(file, i, "write `anchor code: reason` or `anchor test: reason`"));
    }
  }
  return exemptions;
}

void check_page(const Page& page, const SourceFile& file, std::vector<Fault>& faults) {
  for (const std::size_t line_index : page.strays) {
    faults.push_back(tidy::fault_at(file, line_index, "this MUST stands in no rule with anchor"));
  }
  std::set<std::string> seen;
  for (const Rule& rule : page.rules) {
    if (seen.insert(rule.anchor).second) continue;
    faults.push_back(tidy::fault_at(file, rule.line_index, rule.anchor + " stands here again"));
  }
}

}  // namespace

std::vector<Rule> rules_of(std::string_view page) {
  return read_page(page).rules;
}

std::vector<Fault> find_uncovered(const std::vector<SourceFile>& files) {
  std::vector<Fault> faults;
  const SourceFile& exemption_file = file_of(files, kExemptions);
  std::vector<std::pair<const SourceFile*, Page>> pages;
  std::set<std::string> known;
  for (const std::string_view path : kPages) {
    const SourceFile& file = file_of(files, path);
    const Page& page = pages.emplace_back(&file, read_page(file.text)).second;
    check_page(page, file, faults);
    known.insert(page.sections.begin(), page.sections.end());
    for (const Rule& rule : page.rules)
      known.insert(rule.anchor);
  }
  Citations citations = read_citations(files, known);
  std::ranges::move(citations.faults, std::back_inserter(faults));

  // The missing citations; an exemption removes the citations that it covers.
  std::map<std::pair<std::string, std::string>, std::pair<const SourceFile*, std::size_t>> missing;
  for (const auto& [file, page] : pages) {
    for (const Rule& rule : page.rules) {
      if (!rule.is_must) continue;
      for (const Place place : kPlaces) {
        if (citations.anchors[place].contains(rule.anchor)) continue;
        missing.insert({{rule.anchor, std::string(to_string(place))}, {file, rule.line_index}});
      }
    }
  }
  for (const Exemption& exemption : read_exemptions(exemption_file, faults)) {
    if (missing.erase({exemption.anchor, exemption.place}) > 0) continue;
    const char* why = known.contains(exemption.anchor)
                          ? " needs no such exemption; take it away"
                          : " is exempt, but the page does not have it";
    faults.push_back(tidy::fault_at(exemption_file, exemption.line_index, exemption.anchor + why));
  }
  for (const auto& [what, where] : missing) {
    faults.push_back(tidy::fault_at(*where.first, where.second,
                                    what.first + " is cited in no " + what.second +
                                        "; cite it there, or exempt it in spec/exemptions.txt"));
  }
  return faults;
}

}  // namespace rtpm::spec
