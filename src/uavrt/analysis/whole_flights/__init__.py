"""Search whole flights for tags in their recorded samples, and describe the results in
words.
"""
