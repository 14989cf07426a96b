"""A case of each kind is quick, the others are thorough."""

from pathlib import Path

import pytest

QUICK = {
    "test_crashes.py": "test_every_crash_point test_a_disk_that_refuses test_the_order_of_calls",
    "test_damage.py": "test_flipped_bits test_replaced_shards test_verify_and_status_tell_without_touching",
    "test_documents.py": "test_records_of_any_structure test_json_that_is_read",
    "test_going_on.py": "test_going_on_computes_the_rest_only test_a_changed_sweep_is_refused[trajectory.gravity] "
    "test_equal_runs_give_equal_bytes",
    "test_hostile.py": "test_pipes_devices_and_links_to_them test_fuzzed_files",
    "test_hostile_results.py": "test_hostile_files_are_refused[5]",
    "test_isolation.py": "test_one_process_for_all_and_none_for_a_new_run test_hostile_shards[bomb]",
    "test_links.py": "test_a_name_that_somebody_guessed test_a_lock_that_is_no_longer_ours[removed]",
    "test_model.py": "test_any_sequence",
    "test_processes.py": "test_two_writers test_a_folder_that_may_not_be_written",
    "test_processes_of_work.py": "test_a_worker_dies test_groups_are_balanced",
    "test_status.py": "test_status_says_whether_somebody_runs",
    "test_waiting.py": "test_a_picture_is_there_whole_or_not_at_all",
    "test_workers.py": "test_the_sweep_travels_whole",
}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent == Path(__file__).parent:
            names = QUICK.get(item.path.name, "").split()
            assert all(hasattr(item.module, name.partition("[")[0]) for name in names), item.path
            if item.name not in names:
                item.add_marker("thorough")
