import java.awt.BasicStroke;
import java.awt.Color;
import java.awt.Dimension;
import java.awt.Font;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.RenderingHints;
import java.awt.geom.Ellipse2D;
import java.awt.geom.Line2D;
import java.awt.geom.Path2D;
import java.awt.geom.Point2D;
import java.awt.image.BufferedImage;
import java.io.File;
import java.io.IOException;
import java.io.UncheckedIOException;
import java.util.ArrayDeque;
import java.util.Deque;
import java.util.Locale;
import javax.imageio.ImageIO;
import javax.swing.JComponent;
import javax.swing.JFrame;
import javax.swing.SwingUtilities;
import javax.swing.Timer;
import org.rtpm.EventConsumer;
import org.rtpm.EventFilter;
import org.rtpm.Node;
import rtpm.touch.Shape;
import rtpm.touch.State;
import rtpm.touch.Touched;
import rtpm.touch.Vector3;

/**
 * The graphics node of the paper's haptic servo, on any desktop: it draws the touches of the force
 * node, {@code rtpm-servo --events rtpm/events}, as a section through the scene. {@code ./dev servo}
 * starts the other nodes.
 *
 * <p>Arguments: none, or {@code --picture FILE}, which saves the window's content after 3 s and
 * ends. In the folder of this file, beside {@code rtpmc}:
 *
 * <pre>
 * rtpmc --emit java -o generated ../../scene/touch.fbs
 * javac -d classes -cp ../target/rtpm-0.1.0.jar -sourcepath generated HapticScene.java
 * java -cp classes:../target/rtpm-0.1.0.jar HapticScene
 * </pre>
 */
public final class HapticScene extends JComponent {
  private static final long serialVersionUID = 1;
  private static final int FRAME_INTERVAL_MS = 16;
  private static final int PICTURE_AFTER_MS = 3000;
  /** 3 s of a force loop at 1 kHz. */
  private static final int TRAIL_COUNT = 3000;
  /** One in so many touches of the trail shows its force. */
  private static final int FORCE_STRIDE = 40;

  private static final double SPHERE_RADIUS_M = 0.03;
  private static final double PIXELS_PER_M = 6000;
  private static final double PIXELS_PER_NEWTON = 25;

  private static final Color BACKGROUND = new Color(0xf7f7f4);
  private static final Color SOLID = new Color(0xcfd8dc);
  private static final Color TRAIL = new Color(0x90a4ae);
  private static final Color DEVICE = new Color(0x1565c0);
  private static final Color PROXY = new Color(0x2e7d32);
  private static final Color FORCE = new Color(0xc62828);
  private static final Color PAST_FORCE = new Color(0xef9a9a);

  /** Guards itself: the node's thread adds, Swing's draws. */
  private final transient Deque<State> touches = new ArrayDeque<>();

  private HapticScene() {
    setPreferredSize(new Dimension(720, 480));
  }

  private void see(State touch) {
    synchronized (touches) {
      touches.addLast(touch);
      if (touches.size() > TRAIL_COUNT) {
        touches.removeFirst();
      }
    }
  }

  @Override
  protected void paintComponent(Graphics graphics) {
    Graphics2D canvas = (Graphics2D) graphics.create();
    canvas.setRenderingHint(
        RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
    canvas.setColor(BACKGROUND);
    canvas.fillRect(0, 0, getWidth(), getHeight());
    State[] seen;
    synchronized (touches) {
      seen = touches.toArray(new State[0]);
    }
    if (seen.length == 0) {
      canvas.setColor(Color.DARK_GRAY);
      canvas.drawString("no touches yet: is the force node running?", 20, 30);
    } else {
      drawScene(canvas, seen);
    }
    canvas.dispose();
  }

  private void drawScene(Graphics2D canvas, State[] seen) {
    State now = seen[seen.length - 1];
    drawSolid(canvas, now);
    Path2D trail = new Path2D.Double();
    for (State touch : seen) {
      Point2D at = onScreen(touch.deviceM());
      if (trail.getCurrentPoint() == null) {
        trail.moveTo(at.getX(), at.getY());
      }
      trail.lineTo(at.getX(), at.getY());
    }
    canvas.setColor(PAST_FORCE);
    for (int i = 0; i < seen.length; i += FORCE_STRIDE) {
      drawForce(canvas, seen[i]);
    }
    canvas.setColor(TRAIL);
    canvas.draw(trail);
    canvas.setColor(FORCE);
    canvas.setStroke(new BasicStroke(3));
    drawForce(canvas, now);
    dot(canvas, PROXY, onScreen(now.proxyM()), 7);
    dot(canvas, DEVICE, onScreen(now.deviceM()), 5);
    drawNumbers(canvas, now);
  }

  private void drawForce(Graphics2D canvas, State touch) {
    Point2D at = onScreen(touch.proxyM());
    Vector3 force = touch.forceNewton();
    canvas.draw(
        new Line2D.Double(
            at.getX(),
            at.getY(),
            at.getX() + force.x() * PIXELS_PER_NEWTON,
            at.getY() - force.z() * PIXELS_PER_NEWTON));
  }

  private void drawSolid(Graphics2D canvas, State now) {
    Point2D face = onScreen(new Vector3(0, 0, now.faceM()));
    canvas.setColor(SOLID);
    if (now.shape().equals(Shape.SPHERE)) {
      double radius = SPHERE_RADIUS_M * PIXELS_PER_M;
      canvas.fill(
          new Ellipse2D.Double(face.getX() - radius, face.getY(), 2 * radius, 2 * radius));
    } else {
      canvas.fillRect(0, (int) face.getY(), getWidth(), getHeight());
    }
  }

  private void drawNumbers(Graphics2D canvas, State now) {
    Vector3 at = now.deviceM();
    canvas.setColor(Color.DARK_GRAY);
    canvas.setFont(new Font(Font.MONOSPACED, Font.PLAIN, 13));
    canvas.drawString(
        String.format(
            Locale.ROOT,
            "device %+6.1f %+6.1f %+6.1f mm   force %4.2f N   %s",
            at.x() * 1e3, at.y() * 1e3, at.z() * 1e3, newton(now.forceNewton()), now.shape()),
        12,
        20);
    legend(canvas, DEVICE, "device", 12);
    legend(canvas, PROXY, "proxy, on the surface", 92);
    legend(canvas, FORCE, "force", 290);
  }

  private static double newton(Vector3 force) {
    return Math.sqrt(force.x() * force.x() + force.y() * force.y() + force.z() * force.z());
  }

  private void legend(Graphics2D canvas, Color color, String text, int x) {
    int y = getHeight() - 12;
    dot(canvas, color, new Point2D.Double(x + 4, y - 4), 4);
    canvas.setColor(Color.DARK_GRAY);
    canvas.drawString(text, x + 14, y);
  }

  private static void dot(Graphics2D canvas, Color color, Point2D at, double radius) {
    canvas.setColor(color);
    canvas.fill(
        new Ellipse2D.Double(at.getX() - radius, at.getY() - radius, 2 * radius, 2 * radius));
  }

  /** The x-z plane; z points up, and 0 is a third from above. */
  private Point2D onScreen(Vector3 atM) {
    return new Point2D.Double(
        getWidth() / 2.0 + atM.x() * PIXELS_PER_M, getHeight() / 3.0 - atM.z() * PIXELS_PER_M);
  }

  private void save(File file) {
    BufferedImage image =
        new BufferedImage(getWidth(), getHeight(), BufferedImage.TYPE_INT_RGB);
    Graphics2D canvas = image.createGraphics();
    paintComponent(canvas);
    canvas.dispose();
    try {
      ImageIO.write(image, "png", file);
    } catch (IOException e) {
      throw new UncheckedIOException(file + " can't be written", e);
    }
    synchronized (touches) {
      double greatest = 0;
      for (State touch : touches) {
        greatest = Math.max(greatest, newton(touch.forceNewton()));
      }
      System.out.printf(
          Locale.ROOT, "%d touches, at most %.2f N, in %s%n", touches.size(), greatest, file);
    }
  }

  private static void open(HapticScene scene, File picture) {
    JFrame window = new JFrame("RTPM: haptic scene");
    window.setDefaultCloseOperation(JFrame.EXIT_ON_CLOSE);
    window.add(scene);
    window.pack();
    window.setVisible(true);
    new Timer(FRAME_INTERVAL_MS, tick -> scene.repaint()).start();
    if (picture != null) {
      Timer end =
          new Timer(
              PICTURE_AFTER_MS,
              tick -> {
                scene.save(picture);
                System.exit(0);
              });
      end.setRepeats(false);
      end.start();
    }
  }

  /** Draws until the window is closed. */
  public static void main(String[] arguments) throws InterruptedException {
    boolean saves = arguments.length == 2 && arguments[0].equals("--picture");
    if (arguments.length != 0 && !saves) {
      System.err.println("usage: HapticScene [--picture FILE]");
      System.exit(2);
    }
    HapticScene scene = new HapticScene();
    File picture = saves ? new File(arguments[1]) : null;
    try (Node node = Node.open()) {
      EventConsumer.open(
          node,
          "rtpm/events",
          "haptic scene",
          EventFilter.of(Touched.EVENT),
          event -> scene.see(event.value(Touched.EVENT)));
      SwingUtilities.invokeLater(() -> open(scene, picture));
      Thread.currentThread().join();
    }
  }
}
