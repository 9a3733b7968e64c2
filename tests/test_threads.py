"""One thread of linear algebra in a block, as many as before after it."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from elevon.threads import one_blas_thread


def threads():
    return [item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"]


@pytest.fixture(autouse=True)
def _two_before():
    import scipy.linalg  # noqa: F401

    with threadpool_limits(limits=2, user_api="blas"):
        yield


def test_blocks_within_each_other_and_errors_leave_what_was():
    before = threads()
    assert 2 in before
    with pytest.raises(np.linalg.LinAlgError), one_blas_thread():
        with one_blas_thread():
            assert set(threads()) == {1}
        assert set(threads()) == {1}
        np.linalg.cholesky(-np.eye(2))
    assert threads() == before


def test_blocks_that_overlap_leave_what_was():
    before = threads()
    first, second = one_blas_thread(), one_blas_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(threads()) == {1}
    second.__exit__(None, None, None)
    assert threads() == before
