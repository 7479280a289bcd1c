"""Our mathematics against known answers: cases through the public interface, and the table that they make."""
