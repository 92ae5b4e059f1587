//! A look as a whole command for a shell.

use bokehcam::look::Value;

/// The command that shows `source` with these settings, or streams it into `outputs` where there are any; `switches`
/// are other options of that command. Every word is quoted as a POSIX shell needs it.
pub fn equivalent(source: &str, outputs: &[String], flags: &[Value], switches: &[(String, String)]) -> String {
    let mut words = vec!["bokehcam".to_string()];
    words.push(if outputs.is_empty() { "preview" } else { "stream" }.to_string());
    // A source that begins with a dash would be taken for an option: it goes last, after `--`.
    let is_option = source.starts_with('-');
    words.extend((!is_option).then(|| quoted(source)));
    for output in outputs {
        option(&mut words, "to", output);
    }
    for (name, value) in flags {
        option(&mut words, name, value);
    }
    words.extend(switches.iter().map(|(name, value)| quoted(&format!("--{name}={value}"))));
    if is_option {
        words.extend(["--".to_string(), quoted(source)]);
    }
    words.join(" ")
}

/// Appends an option; joined with `=` where its value would be taken for an option. `-` alone is no option.
fn option(words: &mut Vec<String>, name: &str, value: &str) {
    match value.starts_with('-') && value != "-" {
        true => words.push(quoted(&format!("--{name}={value}"))),
        false => words.extend([format!("--{name}"), quoted(value)]),
    }
}

/// `word` in single quotes, unless a shell takes it literally without.
fn quoted(word: &str) -> String {
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
            equivalent("/dev/video0", &[], &flags, &[]),
            "bokehcam preview /dev/video0 --rim 0.1 --intensity=-0.5 --blur 3%"
        );
        let outputs = ["/dev/video10".to_string(), "-".to_string()];
        assert_eq!(
            equivalent("my scene", &outputs, &flags[..1], &[("mirror".to_string(), "true".to_string())]),
            "bokehcam stream 'my scene' --to /dev/video10 --to - --rim 0.1 --mirror=true"
        );
        assert_eq!(equivalent("-x", &[], &flags[..1], &[]), "bokehcam preview --rim 0.1 -- -x");
    }

    /// A shell gives the words back as they were.
    #[test]
    fn a_shell_reads_every_word_back() {
        let nasty =
            ["it's", "", "a b", "$HOME", "`id`", "a\\b", "\"", "*", "~", "#x", "line\nbreak", "ünïcode", "!x", "-a b"];
        for word in nasty {
            let line = equivalent(word, &[], &[("aperture", format!("image:{word}"))], &[]);
            let script = format!("bokehcam() {{ printf '%s\\0' \"$@\"; }}\n{line}");
            let told = std::process::Command::new("sh").args(["-c", &script]).output().unwrap();
            assert!(told.status.success() && told.stderr.is_empty(), "{line}");
            let image = format!("image:{word}");
            let words: Vec<&str> = match word.starts_with('-') {
                true => vec!["preview", "--aperture", &image, "--", word],
                false => vec!["preview", word, "--aperture", &image],
            };
            let told = String::from_utf8(told.stdout).unwrap();
            assert_eq!(told.strip_suffix('\0').unwrap().split('\0').collect::<Vec<_>>(), words, "{line}");
        }
    }
}
