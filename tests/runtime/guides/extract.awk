# extract.awk -v want=INFO FILE.md: the fenced blocks with this info string, one after the other; of C with the guide's lines.
/^```/ {
  if (inside) inside = 0
  else if ($0 == "```" want) {
    inside = 1
    if (want ~ /^c/) printf "#line %d \"%s\"\n", NR + 1, FILENAME
  }
  next
}
inside { print }
