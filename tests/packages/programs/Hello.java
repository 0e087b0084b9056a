import org.rtpm.Node;

class Hello {
  public static void main(String[] arguments) {
    try (Node node = Node.open()) {
      System.out.println("RTPM from Java");
    }
  }
}
