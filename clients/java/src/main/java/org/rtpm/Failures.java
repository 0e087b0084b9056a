package org.rtpm;

import java.net.InetSocketAddress;
import java.nio.ByteBuffer;
import java.nio.charset.CharacterCodingException;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.List;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.values.Interface;
import org.rtpm.values.Method;

/** The messages of calls and binds that failed. */
final class Failures {
  private static final int SIMILAR_COUNT_MAX = 4;

  private static final String OF_REGISTRY =
      "Start rtpm-registryd there, or name another registry by the environment variable "
          + "RTPM_REGISTRY or NodeOptions.withRegistries";

  private Failures() {}

  /** How messages name an object; its name is null if it was bound by its address. */
  static String subject(String name, Address address) {
    if (name != null) {
      return Printable.of(name) + " at " + address.authority();
    }
    return (isRegistry(address) ? "the registry " : "") + address;
  }

  private static boolean isRegistry(Address address) {
    return address.path().equals(Directory.PATH);
  }

  static String ofBind(
      Address address, InetSocketAddress server, Interface description, Outcome outcome) {
    String begin = subject(null, address) + ": bind failed: ";
    String at = server.getAddress().getHostAddress() + ":" + server.getPort();
    return begin
        + switch (outcome.cause()) {
          case DEADLINE, UNREACHABLE, LOST, CLOSED, CANCELLED ->
              at
                  + " did not answer in time. "
                  + (isRegistry(address) ? OF_REGISTRY : "Does its server run?");
          case REFUSED ->
              at + " refused the session: " + outcome.status() + hint(outcome.status());
          case NOT_UNDERSTOOD ->
              "its interface differs from this program's "
                  + description.name()
                  + ". Generate the code of both from one schema";
          case OVERLOAD, TOO_LARGE -> "too many calls wait for " + at;
          case REPLIED -> ofStatus(address, description, outcome);
        };
  }

  private static String hint(Status status) {
    return status == Status.NOT_ALLOWED ? ". It asks for sealed sessions with known keys" : "";
  }

  private static String ofStatus(Address address, Interface description, Outcome outcome) {
    if (outcome.status() == Status.NO_SUCH_OBJECT) {
      List<String> similar = texts(outcome.payload());
      similar.removeIf(path -> !Address.isPath(path));
      return "the server has no object "
          + address.path()
          + (similar.isEmpty() ? "" : ". It has " + String.join(", ", similar));
    }
    if (outcome.status() == Status.WRONG_INTERFACE) {
      List<String> names = texts(outcome.payload());
      String name = names.isEmpty() ? "another interface" : Printable.of(names.get(0));
      return "the object is a " + name + ", not a " + description.name();
    }
    return outcome.status().toString();
  }

  // Texts of u16 length each, at most four.
  private static List<String> texts(byte[] payload) {
    List<String> texts = new ArrayList<>();
    int at = 0;
    while (at + 2 <= payload.length && texts.size() < SIMILAR_COUNT_MAX) {
      int size = Bytes.u16(payload, at);
      if (at + 2 + size > payload.length) {
        break;
      }
      texts.add(new String(payload, at + 2, size, StandardCharsets.UTF_8));
      at += 2 + size;
    }
    return texts;
  }

  static CallException ofCall(
      String name, Address address, Method<?, ?> method, Outcome outcome) {
    String begin = subject(name, address) + ": " + method.name() + ": ";
    WasRun wasRun = outcome.mayHaveRun() ? WasRun.MAYBE : WasRun.NO;
    if (outcome.status() != null) {
      wasRun = outcome.status() == Status.SERVANT_FAILED ? WasRun.YES : wasRun;
      String text = refusalText(outcome);
      String message = begin + outcome.status() + (text.isEmpty() ? "" : ": " + text);
      return new CallException(message, outcome.status(), text, wasRun);
    }
    String reason =
        switch (outcome.cause()) {
          case DEADLINE -> "no answer before its deadline";
          case LOST -> "the server lost the session";
          case CLOSED -> "the server stopped";
          case UNREACHABLE -> "the server can't be reached";
          case TOO_LARGE -> "the request is larger than the server takes";
          case OVERLOAD -> "too many calls wait for the server";
          case NOT_UNDERSTOOD -> "the server's interface has changed";
          default -> "cancelled";
        };
    // As if the server had refused it.
    Status status = outcome.cause() == Outcome.Cause.TOO_LARGE ? Status.TOO_LARGE : null;
    boolean isSilent =
        switch (outcome.cause()) {
          case DEADLINE, LOST, CLOSED, UNREACHABLE -> true;
          default -> false;
        };
    return new CallException(
        begin
            + reason
            + (outcome.mayHaveRun() ? "; it may have run" : "; it did not run")
            + (isSilent && isRegistry(address) ? ". " + OF_REGISTRY : ""),
        status,
        "",
        wasRun);
  }

  static CallException malformedReply(
      String subject, Method<?, ?> method, String reason) {
    return new CallException(
        subject + ": " + method.name() + ": the reply is malformed: " + Printable.of(reason),
        Status.OK,
        "",
        WasRun.YES);
  }

  static CallException tooLarge(
      String subject, Method<?, ?> method, String part, int size, WasRun wasRun) {
    return new CallException(
        subject + ": " + method.name() + ": the " + part + " has " + size
            + " bytes, but the schema allows " + method.maxSize(),
        Status.TOO_LARGE,
        "",
        wasRun);
  }

  // hp-7-1
  private static String refusalText(Outcome outcome) {
    boolean mayHaveText =
        outcome.status() == Status.BAD_REQUEST || outcome.status() == Status.SERVANT_FAILED;
    if (!mayHaveText || outcome.payload().length > 200) {
      return "";
    }
    try {
      return Printable.of(
          StandardCharsets.UTF_8
              .newDecoder()
              .decode(ByteBuffer.wrap(outcome.payload()))
              .toString());
    } catch (CharacterCodingException e) {
      return "";
    }
  }
}
