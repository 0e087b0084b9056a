#include "rtpm/access/subject.hpp"

#include "rtpm/access/fingerprint.hpp"

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
  return public_key_text(subject.key);
}

}  // namespace rtpm::access
