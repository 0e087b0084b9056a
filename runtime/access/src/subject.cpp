#include "rtpm/access/subject.hpp"

#include "rtpm/seal/key_text.hpp"

namespace rtpm::access {

std::string to_text(const Subject& subject) {
  switch (subject.kind) {
    case Subject::Kind::kAnonymous:
      return "anonymous";
    case Subject::Kind::kLocalUser:
      return "uid:" + std::to_string(subject.user);
    case Subject::Kind::kKey:
      break;
  }
  seal::KeyText key;
  seal::encode_key(subject.key, key);
  return std::string(seal::kKeyTextName) + ' ' + std::string(key.data(), key.size());
}

}  // namespace rtpm::access
