package org.rtpm.internal.serve;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.attribute.FileTime;
import java.nio.file.attribute.PosixFilePermissions;
import java.util.Base64;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;
import org.rtpm.internal.wire.Peer;
import org.rtpm.values.Role;

/** The lines of docs/security.md. */
class GrantsTest {
  private static final byte[] KEY = new byte[32];
  private static final String NAME = "rtpm25519 " + Base64.getEncoder().encodeToString(KEY);
  private static final Peer HERE = Peer.of(0, 0xffff_7f00_0001L, 1);

  @TempDir Path folder;

  private static Role role(String text, byte[] key, Peer peer, String path) {
    return new Grants(text).permission(key, peer, path).role();
  }

  @ParameterizedTest
  @CsvSource({
    "**, a/b/c, true", "**, a, true", "a/**, a, true", "a/**, a/b/c, true", "a/*, a/b, true",
    "a/*, a, false", "a/*, a/b/c, false", "*, a, true", "a/b, a/b, true", "a/b, a/c, false",
    "**/c, a/b/c, true", "**/c, c, true", "**/c, a/b, false", "a/**/d, a/b/c/d, true",
    "a/**/d, a/d, true", "**/b/**/d, a/b/b/c/d, true", "**/b/*/d, a/b/b/c/d, true",
    "a/**/*, a, false", "x/a, a, false"
  })
  void patternsCoverPaths(String pattern, String path, boolean isCovered) {
    Role found = role("anonymous role=observe on=" + pattern, null, HERE, path);
    assertEquals(isCovered ? Role.OBSERVE : null, found);
  }

  @Test
  void linesAddUp() {
    String text =
        "# people\n\n  "
            + NAME
            + " name=a role=observe on=lab/** max-priority=9\r\n"
            + NAME
            + "\trole=configure on=x,lab/arm0 max-priority=5\nanonymous role=command on=open";
    Grants grants = new Grants(text);
    assertTrue(grants.faults().isEmpty(), grants.faults().toString());
    assertEquals(
        new Grants.Permission(Role.CONFIGURE, 9), grants.permission(KEY, HERE, "lab/arm0"));
    assertEquals(new Grants.Permission(Role.OBSERVE, 9), grants.permission(KEY, HERE, "lab/arm1"));
    assertNull(grants.permission(KEY, HERE, "open").role());
    assertEquals(Role.COMMAND, grants.permission(null, HERE, "open").role());
    assertFalse(grants.knows(new byte[31]));
  }

  @ParameterizedTest
  @CsvSource({
    "127.0.0.1, true", "127.0.0.0/8, true", "0.0.0.0/0, true", "10.0.0.0/8, false",
    "::ffff:0:0/96, true", "2001:db8::/32, false", "'10.0.0.0/8,127.0.0.1', true"
  })
  void rangesHoldForTheCallersAddress(String from, boolean isWithin) {
    Grants grants = new Grants("anonymous role=observe on=** from=" + from);
    assertTrue(grants.faults().isEmpty(), grants.faults().toString());
    assertEquals(isWithin, grants.permission(null, HERE, "a").role() != null);
    Peer six = Peer.of(0x2001_0db8_0000_0000L, 1, 1);
    assertEquals(from.startsWith("2001"), grants.permission(null, six, "a").role() != null);
  }

  @ParameterizedTest
  @ValueSource(
      strings = {
        "nobody role=observe on=**", "rtpm25519", "rtpm25519 abc role=observe on=**",
        "anonymous on=**", "anonymous role=observe", "anonymous role=god on=**",
        "anonymous role=observe on=/a", "anonymous role=observe on=a//b",
        "anonymous role=observe on=a*", "anonymous role=observe on=** role=command",
        "anonymous role=observe on=** from=host", "anonymous role=observe on=** from=10.0.0.1/8",
        "anonymous role=observe on=** from=10.0.0.0/33", "anonymous role=observe on=** from=1.2",
        "anonymous role=observe on=** max-priority=32768", "anonymous role=observe on=** x=y",
        "anonymous role=observe on=** deny"
      })
  void faultyLinesAllowNothing(String line) {
    Grants grants = new Grants(line + "\nanonymous role=observe on=good");
    assertEquals(1, grants.faults().size());
    assertTrue(grants.faults().get(0).startsWith("1: "));
    assertNull(grants.permission(null, HERE, "a").role());
    assertEquals(Role.OBSERVE, grants.permission(null, HERE, "good").role());
  }

  @Test
  void filesAreReadAgainAndOnlyThoseThatOthersCannotWrite() throws IOException {
    Path file = folder.resolve("authorized");
    Files.writeString(file, "nothing good\n");
    String empty = assertThrows(IOException.class, () -> new GrantFile(file)).getMessage();
    assertTrue(empty.contains("line 1: a line begins with rtpm25519"), empty);
    Files.writeString(file, "anonymous role=observe on=**\n");
    Files.setPosixFilePermissions(file, PosixFilePermissions.fromString("rw-rw-r--"));
    String open = assertThrows(IOException.class, () -> new GrantFile(file)).getMessage();
    assertTrue(open.contains("chmod go-w"), open);
    Files.setPosixFilePermissions(file, PosixFilePermissions.fromString("rw-r--r--"));
    GrantFile grants = new GrantFile(file);
    assertTrue(grants.knows(null));
    Files.writeString(file, NAME + " role=observe on=**\n");
    Files.setLastModifiedTime(file, FileTime.fromMillis(1));
    long later = System.nanoTime() + 2 * GrantFile.LOOK_INTERVAL;
    grants.look(later);
    assertFalse(grants.knows(null));
    assertTrue(grants.knows(KEY));
    Files.delete(file);
    grants.look(later + 2 * GrantFile.LOOK_INTERVAL);
    assertTrue(grants.knows(KEY), "the former grants stay in force");
  }
}
