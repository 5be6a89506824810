# Work in a terminal: files are read from their beginning, and programs print line by line.
while :; do
  for file in method/*.py method/contrast/*.py; do
    printf '\033[1;32m~/evenlight\033[0m$ less %s\n' "$file"
    head -n 50 "$file"
    sleep 9
    printf '\033[1;32m~/evenlight\033[0m$ grep -n return %s\n' "$file"
    grep -n return "$file" | while IFS= read -r line; do printf '%s\n' "$line"; sleep 0.3; done
    sleep 6
  done
  printf '\033[2J\033[H'
done
