#include "rtpm/access/files.hpp"

#include <optional>
#include <span>
#include <utility>

#include "folder.hpp"
#include "os/file.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/crypto/key_text.hpp"
#include "words.hpp"

namespace rtpm::access {
namespace {

/// Secret text, wiped on destruction.
struct SecretText {
  std::string text{};
  ~SecretText() { crypto::wipe(std::as_writable_bytes(std::span(text))); }
};

/// Appends the whole file to `text`, whose memory is reserved so that no copy is left behind.
std::error_code read_all(const os::File& file, std::string& text) {
  text.reserve(kFileSizeMax + 1);
  text.resize(kFileSizeMax + 1);
  std::size_t size = 0;
  while (size < text.size()) {
    const auto count = os::read(file, text.data() + size, text.size() - size);
    if (!count) return count.error();
    if (*count == 0) break;
    size += *count;
  }
  text.resize(size);
  return {};
}

expected<void, SetupError> check(const os::File& file, const std::string& path,
                                 os::Forbidden forbidden) {
  const std::string what = printable(path, kShownWhole) + " is not used";
  const auto distrust = os::distrust_of(file, path, forbidden);
  if (!distrust) return setup_error(what, distrust.error());
  if (*distrust) return setup_error(what, (*distrust)->why, (*distrust)->remedy);
  return {};
}

expected<void, SetupError> write_secret(const std::string& path, std::string_view text) {
  const std::string what = printable(path, kShownWhole) + " can't be made";
  const auto file = os::open(path, os::Mode::kCreate);
  if (!file) {
    if (file.error() == std::errc::file_exists)
      return setup_error(
          what, "there is one already",
          "use it, or move it away first: who trusts the old key does not trust a new one");
    return setup_error(what, file.error());
  }
  std::error_code error = os::write(file->number(), text);
  if (!error) error = os::flush(*file);
  if (!error) return {};
  os::remove(path);
  return setup_error(what, error);
}

}  // namespace

expected<std::string, SetupError> key_folder() {
  if (std::string folder = os::variable("RTPM_KEYS"); !folder.empty()) return folder;
  if (std::string folder = os::default_key_folder(); !folder.empty()) return folder;
  return setup_error("there is no folder for keys",
                     "RTPM_KEYS, " + std::string(os::key_folder_variables()) + " are not set",
                     "set RTPM_KEYS to a folder of your own");
}

expected<std::string, SetupError> key_file_path(const std::string& given, std::string_view name) {
  if (!given.empty()) return given;
  auto folder = key_folder();
  if (folder) folder->append("/").append(name);
  return folder;
}

expected<crypto::KeyPair, SetupError> make_key(const std::string& path, std::string_view comment) {
  if (const auto made = make_folder_of(path); !made) return unexpected{made.error()};
  crypto::KeyPair pair = crypto::KeyPair::generate();
  crypto::KeyText key;
  crypto::encode_key(pair.private_key.bytes(), key);
  SecretText secret;
  // Enough for the whole line, so that growing leaves no copy behind.
  secret.text.reserve(1024);
  secret.text.append(crypto::kKeyTextName).append(" ").append(key.data(), key.size());
  crypto::wipe(std::as_writable_bytes(std::span(key)));
  if (!comment.empty()) secret.text.append(" ").append(printable(comment));
  secret.text += '\n';
  if (auto written = write_secret(path, secret.text); !written) return unexpected{written.error()};
  return pair;
}

expected<crypto::KeyPair, SetupError> read_key(const std::string& path) {
  const std::string what = printable(path, kShownWhole) + " can't be read";
  const auto file = os::open(path, os::Mode::kRead);
  if (!file) {
    const bool is_missing = file.error() == std::errc::no_such_file_or_directory;
    return setup_error(what, file.error(), is_missing ? "make a key: rtpm key new" : "");
  }
  if (auto checked = check(*file, path, os::Forbidden::kToReadOrWrite); !checked)
    return unexpected{checked.error()};
  SecretText secret;
  if (const auto error = read_all(*file, secret.text)) return setup_error(what, error);
  std::optional<crypto::KeyPair> pair;
  visit_lines(secret.text, [&](std::string_view line, std::size_t) {
    const std::vector<Word> words = words_of(line);
    crypto::PrivateKey key;
    if (!pair && words.size() >= 2 && words[0].text == crypto::kKeyTextName &&
        crypto::decode_key(words[1].text, key.bytes()))
      pair = crypto::KeyPair::of(std::move(key));
  });
  if (!pair)
    return setup_error(what, "it has no line 'rtpm25519 KEY'",
                       "move it away and make a key: rtpm key new");
  return std::move(*pair);
}

std::string key_comment(const std::string& path) {
  const auto file = os::open(path, os::Mode::kRead);
  if (!file || !check(*file, path, os::Forbidden::kToReadOrWrite)) return {};
  SecretText secret;
  if (read_all(*file, secret.text)) return {};
  std::string comment;
  visit_lines(secret.text, [&](std::string_view line, std::size_t) {
    const std::vector<Word> words = words_of(line);
    if (comment.empty() && words.size() >= 3 && words[0].text == crypto::kKeyTextName)
      comment = printable(line.substr(words[2].column - 1));
  });
  return comment;
}

expected<std::string, SetupError> read_trusted_file(const std::string& path) {
  const auto file = os::open(path, os::Mode::kRead);
  if (!file) {
    if (file.error() == std::errc::no_such_file_or_directory) return std::string();
    return setup_error(printable(path, kShownWhole) + " can't be read", file.error());
  }
  if (auto checked = check(*file, path, os::Forbidden::kToWrite); !checked)
    return unexpected{checked.error()};
  std::string text;
  if (const auto error = read_all(*file, text))
    return setup_error(printable(path, kShownWhole) + " can't be read", error);
  if (text.size() > kFileSizeMax)
    return setup_error(printable(path, kShownWhole) + " is not used",
                       "it has more than " + std::to_string(kFileSizeMax) + " bytes");
  return text;
}

FileStamp stamp_of(const std::string& path) noexcept {
  return os::stamp_of(path);
}

std::string user_at_host() {
  return os::user_at_host();
}

std::uint32_t this_user() noexcept {
  return os::this_user();
}

expected<void, SetupError> make_folder_of(const std::string& path) {
  const std::error_code error = os::make_folder_of(path);
  if (!error) return {};
  const std::string folder = path.substr(0, path.find_last_of("/\\"));
  return setup_error(printable(folder, kShownWhole) + " can't be made", error);
}

}  // namespace rtpm::access
