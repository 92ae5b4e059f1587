#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| bokehcam_fuzz::recording_file(data));
