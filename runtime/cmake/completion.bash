# Completion of the lsp programs in bash, from what their --help says: options, an option's values, else files.
_lsp_complete() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} words=""
  if [[ $current == -* ]]; then
    words=$("${COMP_WORDS[0]}" --help 2>/dev/null | grep -oE -- '^  ( |-[a-z], )*--[a-z-]+' | grep -oE -- '--[a-z-]+')
  elif [[ $before == --* ]]; then
    words=$("${COMP_WORDS[0]}" --help 2>/dev/null |
      sed -nE "s/^  ( |-[a-z], )*$before ([a-z0-9]+(\|[a-z0-9]+)+)( .*)?$/\2/p" | tr '|' ' ')
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}
complete -o default -F _lsp_complete lsp-bake lsp-merge lsp-validate lsp-info lsp-trace lsp-render lsp-view lsp-compare \
  lsp-bench lsp-sample-scene
