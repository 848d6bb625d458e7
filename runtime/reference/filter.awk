# What Doxygen is given in place of a public header: its comments marked as Doxygen wants them, line by line, so that the
# headers stay plain C without markup. A comment stands for all macros that follow it without an empty line.
function marked(text) {
  sub(/^ *\/\* /, "&\001", text)
  sub(/\/\* \001/, "/** ", text)
  return text
}
function end_group() {
  if (grouped) printf "/**@}*/ "
  grouped = 0
}

# ---- headings of parts ---- say nothing of what follows them.
!comment && /^\/\* ----/ { heading = 1 }
heading {
  if (/\*\//) heading = 0
  end_group()
  print ""
  next
}
# Members that come of the table of sections are described by their struct.
/^#define LSP_ARRAY_SECTION/ { table = 1 }
table {
  if (/^#include/) table = 0
  print ""
  next
}
# A comment on lines of its own is held until it is known what follows.
!comment && /^ *\/\* / {
  comment = 1
  held = ""
}
comment {
  line = comment == 1 ? marked($0) : $0
  comment = 2
  if (NR == 1) sub(/\/\*\* /, "/** @file \n", line)
  held = held line "\n"
  if (/\*\//) {
    comment = 0
    waiting = 1
  }
  next
}
{
  # Behind what they describe.
  if ($0 !~ /^ *\/\//) sub(/ \/\* /, " /**< ")
  if (sub(/^ *\/\/ /, "&\001")) sub(/\/\/ \001/, "/// ")
  else if ($0 !~ /:\/\//) sub(/ \/\/ /, " ///< ")
  if (NR == 1) sub(/^\/\/\/ /, "/// @file\n/// ")
  define = /^#define/ || continued
  continued = define && /\\$/
  if (!define || waiting) end_group()
  if (waiting && define) {
    printf "/**@{*/ "
    grouped = 1
  }
  if (waiting) printf "%s", held
  waiting = 0
  print
}
END {
  if (waiting) printf "%s", held
}
