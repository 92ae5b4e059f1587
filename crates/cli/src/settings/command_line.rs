//! A look as a complete shell command.

use bokehcam::look::Value;

/// Returns the command that shows `source` with these settings, or streams it to `outputs`, if any; `switches` are
/// other options of that command. Words are quoted for a POSIX shell.
pub fn shell_command(source: &str, outputs: &[String], flags: &[Value], switches: &[(String, String)]) -> String {
    let mut words = vec!["bokehcam".to_string()];
    words.push(if outputs.is_empty() { "preview" } else { "stream" }.to_string());
    // A source with a leading dash would be read as an option: it goes last, after `--`.
    let is_option = source.starts_with('-');
    words.extend((!is_option).then(|| quote(source)));
    for output in outputs {
        push_option(&mut words, "to", output);
    }
    for (name, value) in flags {
        push_option(&mut words, name, value);
    }
    words.extend(switches.iter().map(|(name, value)| quote(&format!("--{name}={value}"))));
    if is_option {
        words.extend(["--".to_string(), quote(source)]);
    }
    words.join(" ")
}

/// Appends an option, joined by `=` if its value would be read as an option; `-` alone would not.
fn push_option(words: &mut Vec<String>, name: &str, value: &str) {
    match value.starts_with('-') && value != "-" {
        true => words.push(quote(&format!("--{name}={value}"))),
        false => words.extend([format!("--{name}"), quote(value)]),
    }
}

/// Puts `word` in single quotes, unless a shell reads it literally without.
fn quote(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=:,./%+@".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_read_as_one_would_write_them() {
        let flags = [("rim", "0.1".to_string()), ("intensity", "-0.5".to_string()), ("blur", "3%".to_string())];
        assert_eq!(
            shell_command("/dev/video0", &[], &flags, &[]),
            "bokehcam preview /dev/video0 --rim 0.1 --intensity=-0.5 --blur 3%"
        );
        let outputs = ["/dev/video10".to_string(), "-".to_string()];
        assert_eq!(
            shell_command("my scene", &outputs, &flags[..1], &[("mirror".to_string(), "true".to_string())]),
            "bokehcam stream 'my scene' --to /dev/video10 --to - --rim 0.1 --mirror=true"
        );
        assert_eq!(shell_command("-x", &[], &flags[..1], &[]), "bokehcam preview --rim 0.1 -- -x");
    }

    /// The shell must return the words unchanged.
    #[test]
    fn a_shell_reads_every_word_back() {
        let nasty =
            ["it's", "", "a b", "$HOME", "`id`", "a\\b", "\"", "*", "~", "#x", "line\nbreak", "ünïcode", "!x", "-a b"];
        for word in nasty {
            let line = shell_command(word, &[], &[("aperture", format!("image:{word}"))], &[]);
            let script = format!("bokehcam() {{ printf '%s\\0' \"$@\"; }}\n{line}");
            let output = std::process::Command::new("sh").args(["-c", &script]).output().unwrap();
            assert!(output.status.success() && output.stderr.is_empty(), "{line}");
            let image = format!("image:{word}");
            let words: Vec<&str> = match word.starts_with('-') {
                true => vec!["preview", "--aperture", &image, "--", word],
                false => vec!["preview", word, "--aperture", &image],
            };
            let output = String::from_utf8(output.stdout).unwrap();
            assert_eq!(output.strip_suffix('\0').unwrap().split('\0').collect::<Vec<_>>(), words, "{line}");
        }
    }
}
