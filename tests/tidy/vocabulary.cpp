#include "vocabulary.hpp"

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <regex>
#include <string>
#include <string_view>

namespace rtpm::tidy {
namespace {

// A word, or two in a row, in lower case and without an ending, and the field's term for it.
const std::map<std::string_view, std::string_view>& terms() {
  static const std::map<std::string_view, std::string_view> kTerms{
      {"big room", "fragment buffer"},
      {"bulk", "large message, fragment buffer"},
      {"bury", "reap, retire, release"},
      {"crew", "thread pool"},
      {"departure", "disconnect, eviction"},
      {"foresight", "predictor"},
      {"goodbye", "close, disconnect"},
      {"knock", "ring the doorbell, wake up"},
      {"late answer", "deferred reply"},
      {"late copy", "stale, duplicate"},
      {"late table", "deferred reply"},
      {"learner", "estimator"},
      {"linger", "poll, busy-wait, spin"},
      {"loan", "borrowed thread"},
      {"look around", "poll"},
      {"nap", "pause, idle"},
      {"relief", "follower, rate limit, back-pressure"},
      {"somebody", "the actor's name"},
      {"spare room", "capacity"},
      {"spin sense", "estimator"},
      {"train", "datagram batch, segmentation offload"},
      {"whoever", "the actor's name"},
      {"wish", "interest, subscription, request"},
      {"witness", "stall detector"},
  };
  return kTerms;
}

// Names that are not RTPM's to choose.
bool is_given(std::string_view identifier) {
  return identifier == "RepairWish" ||  // From spec/idl/events.fbs, and part of its fingerprint.
         identifier == "SO_LINGER" || identifier == "ZMQ_LINGER" ||
         identifier.starts_with("libusb_");
}

// The term that `word` should be, a plural or past form included; empty if it may stand.
std::string_view term_for(const std::string& word) {
  for (const std::string_view ending : {"", "s", "es", "ed", "ing", "er", "ers"}) {
    if (!word.ends_with(ending)) continue;
    const auto found = terms().find(std::string_view(word).substr(0, word.size() - ending.size()));
    if (found != terms().end()) return found->second;
  }
  return {};
}

void check_name(const SourceFile& file, std::size_t line, const std::string& name,
                std::vector<Fault>& faults) {
  static const std::regex kWord("[A-Z]+(?![a-z])|[A-Z]?[a-z]+");
  if (is_given(name)) return;
  const auto check = [&](const std::string& word) {
    const std::string_view term = term_for(word);
    if (term.empty()) return;
    faults.push_back(fault_at(
        file, line,
        "'" + name + "': '" + word + "' is not the field's word; write: " + std::string(term)));
  };
  std::string last;
  for (std::sregex_iterator part(name.begin(), name.end(), kWord), end; part != end; ++part) {
    std::string word = part->str();
    std::ranges::transform(word, word.begin(), [](unsigned char letter) {
      return static_cast<char>(std::tolower(letter));
    });
    check(word);
    check(last + " " + word);
    last = word;
  }
}

/// The comment that ends a line, or a line of a block comment, without slashes, stars and label.
/// Nullopt: the line has no comment.
std::optional<std::string> comment_of(const std::string& line) {
  static const std::regex kLabel("^@\\w+ +(\\w+  +)?");
  static const std::regex kBlock("^ *(/\\*\\*| \\*) +");
  std::smatch block;
  if (std::regex_search(line, block, kBlock)) return block.suffix().str();
  const std::size_t at = line.find("//");
  if (at == std::string::npos) return std::nullopt;
  // In a text, or in an address.
  if (at > 0 && (line[at - 1] == ':' || line[at - 1] == '"')) return std::nullopt;
  const std::size_t begin = line.find_first_not_of("/!< ", at);
  if (begin == std::string::npos) return std::string{};
  return std::regex_replace(line.substr(begin), kLabel, "");
}

}  // namespace

std::vector<Fault> find_comments_without_subject(const std::vector<SourceFile>& files) {
  static const std::regex kBegin("(^|[.:!?] +)(What|Of|Who|Whoever|Whose|So many|That which)\\b");
  std::vector<Fault> faults;
  for (const SourceFile& file : files) {
    const bool is_typescript = file.path.ends_with(".ts") || file.path.ends_with(".tsx");
    if (!is_cpp(file) && !is_typescript) continue;
    const std::vector<std::string> lines = lines_of(file.text);
    bool is_at_begin = true;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto comment = comment_of(lines[i]);
      std::smatch found;
      if (comment && std::regex_search(*comment, found, kBegin) &&
          (found.position() > 0 || is_at_begin)) {
        faults.push_back(fault_at(
            file, i,
            "a sentence begins with '" + found[2].str() + "'; write subject, verb, object"));
      }
      is_at_begin = !comment || comment->empty() ||
                    std::string_view(".:!?").find(comment->back()) != std::string_view::npos;
    }
  }
  return faults;
}

std::vector<Fault> find_home_made_words(const std::vector<SourceFile>& files) {
  static const std::regex kIdentifier("[A-Za-z_][A-Za-z0-9_]*");
  std::vector<Fault> faults;
  for (const SourceFile& file : files) {
    check_name(file, 0, file.path.substr(file.path.rfind('/') + 1), faults);
    if (!is_cpp(file)) continue;
    const std::vector<std::string> lines = lines_of(code_of(file.text));
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (std::sregex_iterator found(lines[i].begin(), lines[i].end(), kIdentifier), end;
           found != end; ++found) {
        check_name(file, i, found->str(), faults);
      }
    }
  }
  return faults;
}

}  // namespace rtpm::tidy
